#include "apps/classify/experiment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "apps/common/running/signals.h"
#include "autograd/ops/losses.h"
#include "autograd/optimisers/adam.h"
#include "data/windows/batching.h"
#include "data/windows/split.h"
#include "models/files/classifier_file.h"
#include "models/training/loss/schedule.h"
#include "models/training/task.h"

namespace supertac {
namespace {

constexpr std::size_t kBatch = 64;
constexpr double kLearningRate = 1e-3, kWarmUp = 0.05;

Tensor gather(const WindowSet& windows, std::span<const std::uint32_t> indices) {
  Tensor all(Shape{static_cast<Dim>(indices.size()), static_cast<Dim>(windows.frames()),
                   static_cast<Dim>(windows.array().signals())});
  const std::size_t size = windows.input_size();
  for (std::size_t n = 0; n < indices.size(); ++n)
    windows.window(indices[n], all.values().subspan(n * size, size));
  return all;
}

// Windows [N,T,signals] -> [N,rows,columns,channels].
Tensor last_frames(const Tensor& windows, const TaxelArray& array) {
  const Dim count = windows.dim(0), signals = windows.dim(2), stride = windows.dim(1) * signals;
  Tensor frames(Shape{count, array.rows, array.columns, array.channels});
  for (Dim n = 0; n < count; ++n)
    std::copy_n(windows.data() + (n + 1) * stride - signals, signals, frames.data() + n * signals);
  return frames;
}

// Windows [N,T,signals] -> [N,height,width,channels]; latents are channels of one pixel.
Tensor show(View view, const SuperTac& model, const TaxelArray& array, const Tensor& windows) {
  if (view == View::frame) return last_frames(windows, array);
  if (view == View::super_resolved) return model.infer(windows);
  const Tensor latents = model.encode(windows);
  Tensor x(Shape{latents.dim(0), 1, 1, latents.dim(1)});
  std::ranges::copy(latents.values(), x.data());
  return x;
}

void train(const TextureClassifier& classifier, const Candidate& model, const WindowSet& windows,
           const Dataset& data, const ExperimentSettings& s) {
  const Batching batching(data.train, kBatch, s.seed);
  const auto per_epoch = static_cast<std::uint64_t>(batching.batches_per_epoch());
  const auto total = static_cast<std::int64_t>(per_epoch) * s.epochs;
  const Schedule schedule{.peak = kLearningRate,
                          .warm_up = static_cast<std::int64_t>(kWarmUp * static_cast<double>(total)),
                          .total = total};
  Adam adam(values_of(classifier.parameters()), {.learning_rate = kLearningRate, .clip_norm = 1});
  std::vector<std::uint32_t> indices(batching.batch_size());
  for (std::int64_t step = 0; step < total; ++step) {
    stop_if_interrupted();
    const std::uint64_t epoch = static_cast<std::uint64_t>(step) / per_epoch;
    const std::uint64_t b = static_cast<std::uint64_t>(step) % per_epoch;
    batching.batch(epoch, b, indices);
    Tensor shown = gather(windows, indices);
    const auto size = shown.values().size() / indices.size();
    for (std::size_t n = 0; model.recipe.augment.any() && n < indices.size(); ++n)
      augment(model.recipe.augment, s.seed, batching.sample(epoch, b, n),
              shown.values().subspan(n * size, size), windows.array());
    std::vector<std::int32_t> labels;
    for (const std::uint32_t i : indices) labels.push_back(data.label_of_pass[windows.pass_of(i)]);
    const Variable x(show(s.view, *model.file.model, windows.array(), shown));
    const Variable loss = softmax_cross_entropy(classifier.forward(x), labels);
    if (!std::isfinite(loss.item()))
      throw std::runtime_error("the classifier of " + std::string(kViews[static_cast<int>(s.view)]) +
                               " diverged at step " + std::to_string(step + 1));
    adam.zero_grad();
    backward(loss);
    adam.set_learning_rate(schedule.at(step));
    adam.step();
  }
}

}  // namespace

std::vector<Candidate> load_candidates(const std::vector<std::string>& paths) {
  std::vector<Candidate> all;
  for (const std::string& path : paths) {
    ModelFile file = load_model(path);
    const Recipe recipe = Recipe::of(file, path);
    all.push_back({path, recipe, std::move(file)});
    const Candidate &first = all.front(), &last = all.back();
    if (recipe.split == SplitKind::none)
      throw std::runtime_error(path + ": was trained on all windows (split none), so none is left to test");
    for (const char* key : {"input", "settings", "split", "stride"}) {
      const std::string ours = value_or(last.file.metadata, key), theirs = value_or(first.file.metadata, key);
      if (ours != theirs)
        throw std::runtime_error(path + ": its " + key + " is " + ours + ", that of " + first.path + " is " +
                                 theirs + "; give models that differ in their seeds only");
    }
  }
  return all;
}

std::vector<std::string> classes_of(const WindowSet& windows) {
  std::vector<std::string> names;
  for (const WindowSet::Pass& pass : windows.passes())
    if (std::ranges::find(names, pass.plate) == names.end()) names.push_back(pass.plate);
  if (names.size() < 2)
    throw std::runtime_error("the recordings are of one plate; there is nothing to tell apart");
  return names;
}

Dataset make_dataset(const WindowSet& windows, const Candidate& model,
                     const std::vector<std::string>& classes, std::int64_t stride) {
  std::vector<std::uint32_t> held_out;
  Split split = split_of(windows, model.recipe, held_out);
  // Trials are what they are; other splits are drawn from the windows there are.
  if (model.recipe.split != SplitKind::trial &&
      fingerprint(split) != value_or(model.file.metadata, "split_fingerprint"))
    throw std::runtime_error(model.path +
                             ": its split cannot be repeated on this data, and it may have seen the test "
                             "windows; give the recordings and plates it was trained on");
  Dataset data;
  for (const WindowSet::Pass& pass : windows.passes())
    data.label_of_pass.push_back(
        static_cast<std::int32_t>(std::ranges::find(classes, pass.plate) - classes.begin()));
  std::int64_t number = 0;
  for (const std::uint32_t i : split.train)
    if (windows.contact(i) && number++ % stride == 0) data.train.push_back(i);
  if (data.train.empty()) throw std::runtime_error("no training window is in contact with its plate");
  data.test = std::move(split.test);
  return data;
}

std::vector<std::int32_t> answers(const Candidate& model, const WindowSet& windows, const Dataset& data,
                                  const std::vector<std::string>& classes,
                                  const ExperimentSettings& settings) {
  const auto shown = [&](std::span<const std::uint32_t> indices) {
    return show(settings.view, *model.file.model, windows.array(), gather(windows, indices));
  };
  const Tensor sample = shown(std::span(data.train).first(1));
  const auto count = static_cast<Dim>(classes.size());
  const ClassifierSettings network{
      .height = sample.dim(1), .width = sample.dim(2), .channels = sample.dim(3), .classes = count};
  Rng rng(settings.seed);
  const TextureClassifier classifier(network, rng);
  train(classifier, model, windows, data, settings);
  if (!settings.keep.path.empty()) save_classifier(settings.keep, classifier, network, classes);
  const NoGrad no_grad;
  const std::span<const std::uint32_t> test(data.test);
  std::vector<std::int32_t> result;
  for (std::size_t first = 0; first < test.size(); first += kBatch) {
    stop_if_interrupted();
    const Variable x(shown(test.subspan(first, std::min(kBatch, test.size() - first))));
    const Tensor logits = classifier.forward(x).value();
    for (const real* row = logits.data(); row != logits.data() + logits.values().size(); row += count)
      result.push_back(static_cast<std::int32_t>(std::max_element(row, row + count) - row));
  }
  return result;
}

}  // namespace supertac
