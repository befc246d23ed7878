#include "apps/classify/experiment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <variant>

#include "apps/common/running/signals.h"
#include "autograd/ops/losses.h"
#include "autograd/optimisers/adam.h"
#include "data/windows/batching.h"
#include "models/files/classifier_file.h"
#include "models/training/loss/schedule.h"

namespace supertac {
namespace {

constexpr double kWarmUp = 0.05;

// The classifier that fits the view.
using Classifier = std::variant<FeatureClassifier, TextureClassifier>;

Classifier make_classifier(const Shape& sample, Dim classes, std::uint64_t seed) {
  Rng rng(seed);
  if (sample.rank() == 2) return FeatureClassifier(sample[1], classes, rng);
  return TextureClassifier(
      {.height = sample[1], .width = sample[2], .channels = sample[3], .classes = classes}, rng);
}

Variable forward(const Classifier& classifier, const Variable& x) {
  return std::visit([&](const auto& kind) { return kind.forward(x); }, classifier);
}

std::vector<Variable> parameters_of(const Classifier& classifier) {
  return std::visit([](const Module& kind) { return values_of(kind.parameters()); }, classifier);
}

Tensor gather(const WindowSet& data, std::span<const std::uint32_t> indices) {
  Tensor windows(Shape{static_cast<Dim>(indices.size()), static_cast<Dim>(data.frames()),
                       static_cast<Dim>(data.array().signals())});
  const std::size_t size = data.input_size();
  for (std::size_t n = 0; n < indices.size(); ++n) {
    data.window(indices[n], windows.values().subspan(n * size, size));
  }
  return windows;
}

std::vector<std::int32_t> labels_of(const WindowSet& data, const Exam& exam,
                                    std::span<const std::uint32_t> indices) {
  std::vector<std::int32_t> labels;
  for (const std::uint32_t i : indices) labels.push_back(exam.label_of_pass[data.pass_of(i)]);
  return labels;
}

void train(const Classifier& classifier, const View& view, const SuperTac& model, const WindowSet& data,
           const Exam& exam, const ExperimentSettings& s) {
  const Batching batching(exam.train, static_cast<std::size_t>(s.batch), s.seed);
  const auto per_epoch = static_cast<std::uint64_t>(batching.batches_per_epoch());
  const auto total = static_cast<std::int64_t>(per_epoch) * s.epochs;
  const Schedule schedule{.peak = s.learning_rate,
                          .warm_up = static_cast<std::int64_t>(kWarmUp * static_cast<double>(total)),
                          .total = total};
  Adam adam(parameters_of(classifier), {.learning_rate = s.learning_rate, .clip_norm = 1});
  std::vector<std::uint32_t> indices(batching.batch_size());
  for (std::int64_t step = 0; step < total; ++step) {
    stop_if_interrupted();
    const std::uint64_t epoch = static_cast<std::uint64_t>(step) / per_epoch;
    const std::uint64_t b = static_cast<std::uint64_t>(step) % per_epoch;
    batching.batch(epoch, b, indices);
    Tensor windows = gather(data, indices);
    const auto size = windows.values().size() / indices.size();
    for (std::size_t n = 0; s.augment.any() && n < indices.size(); ++n) {
      augment(s.augment, s.seed, batching.sample(epoch, b, n), windows.values().subspan(n * size, size),
              data.array());
    }
    const Variable x(show(view, model, data, indices, windows));
    const Variable loss = softmax_cross_entropy(forward(classifier, x), labels_of(data, exam, indices));
    if (!std::isfinite(loss.item())) {
      throw std::runtime_error("the classifier of view " + view.name() + " diverged at step " +
                               std::to_string(step + 1) + "; lower --learning-rate");
    }
    adam.zero_grad();
    backward(loss);
    adam.set_learning_rate(schedule.at(step));
    adam.step();
  }
}

}  // namespace

std::vector<std::int32_t> answers(const View& view, const SuperTac& model, const WindowSet& data,
                                  const Exam& exam, const std::vector<std::string>& classes,
                                  const ExperimentSettings& settings) {
  const std::span<const std::uint32_t> test(exam.test), one = std::span(exam.train).first(1);
  const Tensor sample = show(view, model, data, one, gather(data, one));
  const Classifier classifier = make_classifier(sample.shape(), exam.classes, settings.seed);
  train(classifier, view, model, data, exam, settings);
  if (!settings.keep.path.empty())
    save_classifier(settings.keep, std::get<TextureClassifier>(classifier),
                    {.height = sample.dim(1), .width = sample.dim(2)}, classes);
  const NoGrad no_grad;
  const auto batch = static_cast<std::size_t>(settings.batch);
  std::vector<std::int32_t> result;
  for (std::size_t first = 0; first < test.size(); first += batch) {
    stop_if_interrupted();
    const auto indices = test.subspan(first, std::min(batch, test.size() - first));
    const Variable x(show(view, model, data, indices, gather(data, indices)));
    const Variable logits = forward(classifier, x);
    for (std::size_t n = 0; n < indices.size(); ++n) {
      const real* row = logits.value().data() + static_cast<Dim>(n) * exam.classes;
      result.push_back(static_cast<std::int32_t>(std::max_element(row, row + exam.classes) - row));
    }
  }
  return result;
}

}  // namespace supertac
