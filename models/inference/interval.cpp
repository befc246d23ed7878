#include "models/inference/interval.h"

#include <cmath>
#include <numeric>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

std::size_t IntervalFactors::level_of(float picture) {
  return static_cast<std::size_t>(
      std::ranges::count_if(kEdges, [height = std::abs(picture)](float edge) { return height >= edge; }));
}

void IntervalFactors::half_widths(std::span<const float> picture, std::span<const float> predicted_error,
                                  std::vector<float>& widths) const {
  widths.resize(predicted_error.size());
  for (std::size_t i = 0; i < widths.size(); ++i) widths[i] = half_width(picture[i], predicted_error[i]);
}

std::string IntervalFactors::text() const {
  if (std::ranges::all_of(of_level, [&](double f) { return f == of_level[0]; })) return format(of_level[0]);
  std::string text;
  for (const double factor : of_level) text += (text.empty() ? "" : ",") + format(factor);
  return text;
}

std::optional<IntervalFactors> IntervalFactors::read(const std::string& text) {
  const std::vector<std::string> parts = comma_list(text);
  if (parts.size() != 1 && parts.size() != kLevels) return std::nullopt;
  IntervalFactors factors;
  for (std::size_t level = 0; level < kLevels; ++level) {
    const auto factor = parse_double(parts[parts.size() == 1 ? 0 : level]);
    if (!factor || !(*factor >= 0.05 && *factor <= 100)) return std::nullopt;
    factors.of_level[level] = *factor;
  }
  return factors;
}

void IntervalCoverage::add(std::size_t pass, std::span<const float> picture, std::span<const float> truth,
                           std::span<const float> predicted_error) {
  if (passes_.empty() || passes_.back().number != pass) passes_.push_back({.number = pass});
  Pass& counts = passes_.back();
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const double error = std::abs(double{picture[i]} - double{truth[i]}),
                 half_width = double{judged_.half_width(picture[i], predicted_error[i])},
                 bin = error / double{at_least(predicted_error[i])} * kBinsPerUnit;
    const std::size_t level = IntervalFactors::level_of(picture[i]), height = truth[i] == 0                ? 0
                                                                              : std::abs(truth[i]) <= 0.2F ? 1
                                                                              : std::abs(truth[i]) <= 0.5F
                                                                                  ? 2
                                                                                  : 3;
    const bool within = error <= half_width;
    if (bin < double{kBins}) ++counts.ratios[level][static_cast<std::size_t>(bin)];
    ++counts.pixels[level];
    counts.within += within ? 1 : 0;
    for (Sum* sum : {&heights_[height], &levels_[level]})
      sum->within += within ? 1 : 0, sum->half_width += half_width, sum->pixels += 1;
  }
}

double IntervalCoverage::share() const {
  double sum = 0;
  for (const Pass& pass : passes_)
    sum += static_cast<double>(pass.within) /
           static_cast<double>(std::accumulate(pass.pixels.begin(), pass.pixels.end(), std::uint64_t{0}));
  return sum / static_cast<double>(passes_.size());
}

std::optional<double> IntervalCoverage::factor_of(std::size_t level) const {
  std::array<double, kBins> share{};  // of the ratios in each bin, mean over passes
  double passes = 0;
  for (const Pass& pass : passes_) {
    if (pass.pixels[level] == 0) continue;
    ++passes;
    for (std::size_t bin = 0; bin < kBins; ++bin)
      share[bin] += pass.ratios[level][bin] / static_cast<double>(pass.pixels[level]);
  }
  if (passes == 0) return std::nullopt;
  double covered = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    covered += share[bin];
    if (covered >= kCovered * passes * (1 - 1e-12)) return static_cast<double>(bin + 1) / kBinsPerUnit;
  }
  return double{kBins} / kBinsPerUnit;
}

IntervalFactors IntervalCoverage::factors() const {
  IntervalFactors factors;
  constexpr std::size_t kMiddle = IntervalFactors::kLevels / 2;
  std::optional<double> any;
  for (std::size_t level = 0; level < IntervalFactors::kLevels && !any; ++level) any = factor_of(level);
  factors.of_level[kMiddle] = factor_of(kMiddle).value_or(*any);
  for (std::size_t level = kMiddle; level-- > 0;)
    factors.of_level[level] = factor_of(level).value_or(factors.of_level[level + 1]);
  for (std::size_t level = kMiddle + 1; level < IntervalFactors::kLevels; ++level)
    factors.of_level[level] = factor_of(level).value_or(factors.of_level[level - 1]);
  return factors;
}

}  // namespace supertac
