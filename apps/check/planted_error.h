// An error in the reverse step of one op, put there to see whether the gradient check finds and names it.
#pragma once

#include <string>

#include "autograd/reverse_watch.h"

namespace supertac {

struct Plant {
  enum class Kind { sign, factor, term, index };
  std::string op;         ///< "conv2d"
  std::size_t input = 0;  ///< whose gradient is spoiled
  Kind kind = Kind::sign;
};
/// sign: -g.  factor: 2 g.  term: one element of dL/dy is left out of g.  index: g, each element one place
/// further.
inline constexpr Plant::Kind kPlantKinds[] = {Plant::Kind::sign, Plant::Kind::factor, Plant::Kind::term,
                                              Plant::Kind::index};
std::string name_of(Plant::Kind kind);

/// While it lives, what the op's reverse step adds to the gradient of that input is spoiled.
class PlantedError : public ReverseWatch {
 public:
  explicit PlantedError(Plant plant) : plant_(std::move(plant)) {}
  void reverse(const char* op, std::size_t inputs, Backward& b, const std::function<void()>& step) override;
  /// Whether any gradient became another one: the same number everywhere is the same at every index.
  bool changed() const { return changed_; }

 private:
  Plant plant_;
  bool changed_ = false;
};

}  // namespace supertac
