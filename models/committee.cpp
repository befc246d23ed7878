#include "models/committee.h"

#include <stdexcept>
#include <string>
#include <utility>

namespace supertac {

Committee::Committee(std::span<const ModelFile> files) {
  if (files.empty()) throw std::invalid_argument("Committee: expected at least one model, got none");
  for (const ModelFile& file : files) members_.push_back(&file.network());
}

Tensor Committee::infer(const Tensor& inputs) const {
  Tensor mean = members_.front()->infer(inputs);
  if (members_.size() == 1) return mean;
  for (std::size_t m = 1; m < members_.size(); ++m) {
    const Tensor pictures = members_[m]->infer(inputs);
    for (std::size_t i = 0; i < mean.values().size(); ++i) mean.values()[i] += pictures.values()[i];
  }
  for (real& value : mean.values()) value /= static_cast<real>(members_.size());
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
