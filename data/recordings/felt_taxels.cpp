#include "data/recordings/felt_taxels.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/numbers/text.h"

namespace supertac {

void FeltTaxels::add(const Recording& recording) {
  if (recording.source != "simulated" || recording.frames() == 0) return;
  const std::size_t signals = recording.array.signals();
  if (low_.empty()) {
    array_ = recording.array, span_ = std::abs(recording.signal_scale.span);
    flat_ = recording.body.value_or(Body::usual(array_)).shape == BodyShape::flat;
    low_.assign(recording.signals.begin(), recording.signals.begin() + static_cast<std::ptrdiff_t>(signals));
    high_ = low_;
  }
  if (recording.array != array_) return;
  for (std::size_t i = 0; i < recording.signals.size(); ++i) {
    low_[i % signals] = std::min(low_[i % signals], recording.signals[i]);
    high_[i % signals] = std::max(high_[i % signals], recording.signals[i]);
  }
}

std::vector<int> FeltTaxels::unfelt() const {
  std::vector<int> taxels;
  const auto channels = static_cast<std::size_t>(array_.channels);
  for (std::size_t k = 0; k < low_.size() / channels; ++k) {
    float most = 0;
    for (std::size_t s = k * channels; s < (k + 1) * channels; ++s) most = std::max(most, high_[s] - low_[s]);
    if (most < 0.1F * static_cast<float>(span_)) taxels.push_back(static_cast<int>(k));
  }
  return taxels;
}

std::string FeltTaxels::complaint() const {
  const std::vector<int> taxels = unfelt();
  if (4 * taxels.size() <= 3 * static_cast<std::size_t>(array_.taxels())) return "";
  std::vector<std::string> runs;
  for (std::size_t i = 0, end = 0; i < taxels.size(); i = end) {
    for (end = i + 1; end < taxels.size() && taxels[end] == taxels[end - 1] + 1;) ++end;
    runs.push_back(std::to_string(taxels[i]) + (end - i > 1 ? "-" + std::to_string(taxels[end - 1]) : ""));
  }
  return std::to_string(taxels.size()) + " of " + std::to_string(array_.taxels()) +
         (taxels.size() == 1 ? " taxels feels nothing: " : " taxels feel nothing: ") + joined(runs, ", ") +
         "; a network would learn that they never do. " +
         (flat_ ? "Simulate presses (supertac-simulate --presses N), which reach every taxel"
                : "Say in the sensor's file what shape the array has, \"body\": {\"shape\": \"flat\"}, and "
                  "simulate again");
}

void FeltTaxels::check() const {
  if (const std::string found = complaint(); !found.empty()) throw std::runtime_error(found);
}

}  // namespace supertac
