// The recordings of a folder that are used: those of some plates, or all.
#pragma once

#include <set>
#include <string>
#include <vector>

namespace supertac {

class ChosenPlates {
 public:
  /// All plates when `plates` is empty.
  explicit ChosenPlates(const std::vector<std::string>& plates);
  /// Whether a recording of this plate is used.
  bool take(const std::string& plate);
  /// To be called after all recordings of the folder: throws std::invalid_argument naming a chosen plate
  /// without one.
  void check(const std::string& folder) const;

 private:
  std::set<std::string> chosen_, missing_, found_;
};

}  // namespace supertac
