#include "models/committee.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace supertac {

static double square(real x) { return static_cast<double>(x) * static_cast<double>(x); }

Precision precision_of(const std::string& name) {
  if (name == "fp32") return Precision::fp32;
  if (name == "int8") return Precision::int8;
  throw std::invalid_argument("precision must be fp32 or int8, got \"" + name + "\"");
}

Committee::Committee(std::span<const ModelFile> files, Precision precision) {
  if (files.empty()) throw std::invalid_argument("Committee: expected at least one model, got none");
  for (const ModelFile& file : files) {
    if (precision == Precision::fp32) {
      members_.emplace_back(file.network());
    } else if (file.ranges) {
      members_.emplace_back(file.network(), *file.ranges);
    } else {
      throw std::runtime_error(
          "the model was saved without the ranges of its values, which precision int8 "
          "needs; train it anew with this version, or take precision fp32");
    }
  }
}

Estimate Committee::estimate(const Tensor& inputs) const {
  Estimate mean = members_.front().estimate(inputs);
  if (members_.size() == 1) return mean;
  const bool spread = mean.spread.defined();
  const auto count = static_cast<real>(members_.size());
  const auto pixels = static_cast<std::size_t>(mean.picture.size());
  std::vector<double> squares(spread ? pixels : 0);
  mean.picture = mean.picture.clone();
  for (std::size_t m = 0; m < members_.size(); ++m) {
    const Estimate one = m == 0 ? mean : members_[m].estimate(inputs);
    for (std::size_t i = 0; i < squares.size(); ++i)
      squares[i] += square(one.picture.values()[i]) + square(one.spread.values()[i]);
    for (std::size_t i = 0; m > 0 && i < pixels; ++i) mean.picture.values()[i] += one.picture.values()[i];
  }
  for (real& value : mean.picture.values()) value /= count;
  if (!spread) return mean;
  mean.spread = Tensor(mean.picture.shape());
  for (std::size_t i = 0; i < pixels; ++i)
    mean.spread.values()[i] =
        static_cast<real>(std::sqrt(std::max(0.0, squares[i] / count - square(mean.picture.values()[i]))));
  return mean;
}

std::vector<ModelFile> load_models(std::span<const std::string> paths, ModelKind kind) {
  std::vector<ModelFile> files;
  for (const std::string& path : paths) {
    files.push_back(load_model(path, kind));
    const auto first = files.front().description();
    for (const auto& [key, ours] : files.back().description())
      if (ours != first.at(key)) {
        throw std::runtime_error(path + ": its " + key + " are " + ours + ", those of " + paths.front() +
                                 " " + first.at(key) + "; average models that differ in their seeds only");
      }
  }
  return files;
}

}  // namespace supertac
