#include "apps/stream/pressed_order.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace supertac {

std::string PressedOrder::start() {
  const std::lock_guard lock(mutex_);
  if (path_.empty()) return says_ = "there is no file to write the order to: probe with --out FILE";
  asks_ = true, pressed_.clear(), least_.clear();
  return says_ = "";
}

std::string PressedOrder::skip() {
  const std::lock_guard lock(mutex_);
  if (asks_) take(-1);
  return says_;
}

std::string PressedOrder::leave() {
  const std::lock_guard lock(mutex_);
  if (std::exchange(asks_, false)) says_ = "left: " + path_ + " is as it was";
  return says_;
}

PressedOrder::Status PressedOrder::status() const {
  const std::lock_guard lock(mutex_);
  return {asks_ ? std::optional(static_cast<int>(pressed_.size())) : std::nullopt, says_};
}

void PressedOrder::push(std::span<const double> loads) {
  const std::lock_guard lock(mutex_);
  if (!asks_) return;
  if (least_.empty()) least_.assign(loads.begin(), loads.end()), peaks_.assign(loads.size(), 0);
  double highest = 0;
  for (std::size_t k = 0; k < loads.size(); ++k) {
    if (std::ranges::find(silent_, static_cast<int>(k)) != silent_.end()) continue;
    least_[k] = std::min(least_[k], loads[k]);
    highest = std::max(highest, loads[k] - least_[k]), peaks_[k] = std::max(peaks_[k], loads[k] - least_[k]);
  }
  const double peak = std::ranges::max(peaks_);
  if (peak < 0.05 * std::abs(draft_.scale.span) || highest > peak / 3) return;
  answer();
  least_.clear();
}

void PressedOrder::answer() {
  const auto first = std::ranges::max_element(peaks_);
  const int taxel = static_cast<int>(first - peaks_.begin()), columns = draft_.array.columns;
  const double peak = std::exchange(*first, 0);
  const auto second = std::ranges::max_element(peaks_);
  const int place = static_cast<int>(std::ranges::find(pressed_, taxel) - pressed_.begin());
  if (*second > 0.8 * peak)
    says_ = "taxels " + std::to_string(taxel) + " and " + std::to_string(second - peaks_.begin()) +
            " answered alike: press one place alone";
  else if (place < std::ssize(pressed_))
    says_ = "taxel " + std::to_string(taxel) + " answered again, as at row " +
            std::to_string(place / columns) + ", column " + std::to_string(place % columns);
  else
    take(taxel);
}

void PressedOrder::take(int taxel) {
  pressed_.push_back(taxel), says_.clear();
  if (std::ssize(pressed_) < draft_.array.taxels()) return;
  asks_ = false;
  try {
    write();
    says_ = path_ + " has the order; supertac-stream --sensor " + path_ + " --web shows it";
  } catch (const std::exception& error) {
    says_ = error.what();
  }
}

// What no finger moved goes to the places that were skipped, and is made of those around it.
void PressedOrder::write() const {
  std::vector<int> order, dead;
  for (const int taxel : pressed_)
    order.push_back(taxel < 0 || draft_.order.empty() ? taxel
                                                      : draft_.order[static_cast<std::size_t>(taxel)]);
  for (int at = 0; at < static_cast<int>(draft_.values()) / draft_.array.channels; ++at)
    if (std::ranges::find(order, at) == order.end()) {
      const auto skipped = std::ranges::find(order, -1);
      *skipped = at, dead.push_back(static_cast<int>(skipped - order.begin()));
    }
  Sensor sensor = draft_;
  sensor.reorder(order);
  sensor.dead = dead;
  if (json_of(read_sensor(path_)) != json_of(draft_))
    throw FileError(path_, "is not what the probe wrote any more, and stays as it is; probe again");
  write_sensor(path_, sensor);
}

}  // namespace supertac
