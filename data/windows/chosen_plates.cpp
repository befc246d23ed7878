#include "data/windows/chosen_plates.h"

#include <stdexcept>

namespace supertac {

ChosenPlates::ChosenPlates(const std::vector<std::string>& plates)
    : chosen_(plates.begin(), plates.end()), missing_(chosen_) {}

bool ChosenPlates::take(const std::string& plate) {
  found_.insert(plate);
  missing_.erase(plate);
  return chosen_.empty() || chosen_.contains(plate);
}

void ChosenPlates::check(const std::string& folder) const {
  if (missing_.empty()) return;
  std::string names;
  for (const std::string& name : found_) names += (names.empty() ? "" : ", ") + name;
  throw std::invalid_argument("windows: plate '" + *missing_.begin() + "' has no recording in " + folder +
                              "; it has those of " + names);
}

}  // namespace supertac
