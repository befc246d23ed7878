#include "models/inference/committee.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "models/inference/interval.h"

namespace supertac {
namespace {

constexpr double kMostDoubt = 0.15;  // chosen on trial 1, as the twentieth below

double square(real x) { return static_cast<double>(x) * static_cast<double>(x); }

Estimate mean_of(std::span<const Prepared> members, const Tensor& inputs) {
  Estimate mean = members.front().estimate(inputs);
  if (members.size() == 1) return mean;
  const bool spread = mean.spread.defined();
  const auto count = static_cast<real>(members.size());
  const auto pixels = static_cast<std::size_t>(mean.picture.size());
  std::vector<double> squares(spread ? pixels : 0);
  mean.picture = mean.picture.clone();
  for (std::size_t m = 0; m < members.size(); ++m) {
    const Estimate one = m == 0 ? mean : members[m].estimate(inputs);
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

/// Whether what is recalled of a window is to be trusted beside what is felt of it, [H,W] each.
bool agree(std::span<const real> recalled, std::span<const real> spread, std::span<const real> felt,
           const ImageGrid& grid) {
  Tensor errors(Shape{static_cast<Dim>(recalled.size())});  // of a pool: nothing of the heap
  for (std::size_t i = 0; i < recalled.size(); ++i)
    errors.values()[i] = static_cast<real>(std::sqrt(square(spread[i]) + square(recalled[i] - felt[i]) / 20));
  return doubt_of(recalled, errors.values(), grid) < kMostDoubt;
}

/// Puts what is felt in place of what is recalled wherever the two disagree.
Estimate gated(Estimate recalled, const Estimate& felt) {
  const auto windows = static_cast<std::size_t>(recalled.picture.dim(0));
  const ImageGrid grid{.height = static_cast<int>(recalled.picture.dim(1)),
                       .width = static_cast<int>(recalled.picture.dim(2))};
  recalled.picture = recalled.picture.clone(), recalled.spread = recalled.spread.clone();
  recalled.unfamiliar = Tensor(Shape{recalled.picture.dim(0)});
  for (std::size_t n = 0; n < windows; ++n) {
    const auto of = [&](auto& all) { return all.values().subspan(n * grid.pixels(), grid.pixels()); };
    const bool familiar = agree(of(recalled.picture), of(recalled.spread), of(felt.picture), grid);
    recalled.unfamiliar.values()[n] = familiar ? 0 : 1;
    if (familiar) continue;
    std::ranges::copy(of(felt.picture), of(recalled.picture).begin());
    std::ranges::copy(of(felt.spread), of(recalled.spread).begin());
  }
  return recalled;
}

std::runtime_error unlike(const std::string& path, const std::string& what, const std::string& ours,
                          const std::string& other_path, const std::string& theirs,
                          const std::string& advice) {
  return std::runtime_error(path + ": its " + what + " are " + ours + ", those of " + other_path + " " +
                            theirs + "; " + advice);
}

void expect_seeds_apart(const ModelFile& file, const std::string& path, const ModelFile& other,
                        const std::string& other_path) {
  const auto theirs = other.description();
  for (const auto& [key, ours] : file.description())
    if (ours != theirs.at(key))
      throw unlike(path, key, ours, other_path, theirs.at(key),
                   "average models that differ in their seeds only");
}

/// Networks of two kinds may be of any size, and one may have learnt behind filters of several kinds.
void expect_one_window(const ModelFile& file, const std::string& path, const ModelFile& other,
                       const std::string& other_path) {
  const std::string advice = "put models beside each other that see the same windows";
  const auto input = [](const ModelFile& of, const ModelFile& beside) {
    InputSettings settings = of.input;
    if (!beside.input.filter_s) settings.filter_s.reset();
    return model_metadata(of.model->settings(), settings).at("input");
  };
  const std::string ours = input(file, other), theirs = input(other, file);
  if (ours != theirs) throw unlike(path, "input", ours, other_path, theirs, advice);
  if (file.network().format() != other.network().format())
    throw unlike(path, "settings", file.description().at("settings"), other_path,
                 other.description().at("settings"), advice);
  for (const auto& [model, of] : {std::pair(&file, &path), std::pair(&other, &other_path)})
    if (!model->model->settings().spread)
      throw std::runtime_error(*of +
                               ": expected a model that draws how far off its pixels may be, found one "
                               "that does not; train it anew with this version");
}

}  // namespace

Precision precision_of(const std::string& name) {
  if (name == "fp32") return Precision::fp32;
  if (name == "int8") return Precision::int8;
  throw std::invalid_argument("precision must be fp32 or int8, got \"" + name + "\"");
}

Committee::Committee(std::span<const ModelFile> files, Precision precision) {
  if (files.empty()) throw std::invalid_argument("Committee: expected at least one model, got none");
  for (const ModelFile& file : files) {
    std::vector<Prepared>& kind = file.knows_random_plates() ? feeling_ : recalling_;
    if (precision == Precision::fp32) {
      kind.emplace_back(file.network());
    } else if (file.ranges) {
      kind.emplace_back(file.network(), *file.ranges);
    } else {
      throw std::runtime_error(
          "the model was saved without the ranges of its values, which precision int8 "
          "needs; train it anew with this version, or take precision fp32");
    }
  }
  if (recalling_.empty()) recalling_.swap(feeling_);
}

Estimate Committee::estimate(const Tensor& inputs) const {
  Estimate recalled = mean_of(recalling_, inputs);
  return feeling_.empty() ? recalled : gated(std::move(recalled), mean_of(feeling_, inputs));
}

std::vector<ModelFile> load_models(std::span<const std::string> paths, ModelKind kind) {
  std::vector<ModelFile> files;
  for (const std::string& path : paths) {
    files.push_back(load_model(path, kind));
    const ModelFile& file = files.back();
    const auto alike = std::ranges::find(files, file.knows_random_plates(), &ModelFile::knows_random_plates);
    const auto first = static_cast<std::size_t>(alike - files.begin());
    expect_seeds_apart(file, path, *alike, paths[first]);
    if (first > 0 && first + 1 == files.size()) expect_one_window(file, path, files.front(), paths.front());
  }
  return files;
}

}  // namespace supertac
