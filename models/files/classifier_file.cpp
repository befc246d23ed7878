#include "models/files/classifier_file.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/files/json.h"
#include "io/numbers/text.h"
#include "layers/checkpoint.h"

namespace supertac {
namespace {

constexpr const char* kKind = "texture-classifier";

}  // namespace

NamedClassifier::Answer NamedClassifier::name_of(std::span<const float> picture) const {
  Tensor x(Shape{1, settings.height, settings.width, 1});
  if (picture.size() != x.values().size())
    throw std::invalid_argument("classifier: expects a picture of " + std::to_string(settings.height) + "x" +
                                std::to_string(settings.width) + ", got " + std::to_string(picture.size()) +
                                " pixels");
  std::copy(picture.begin(), picture.end(), x.values().begin());
  const NoGrad no_grad;
  const Tensor logits = network->forward(Variable(x)).value();
  const auto best = std::max_element(logits.values().begin(), logits.values().end());
  double sum = 0;
  for (const real logit : logits.values()) sum += std::exp(static_cast<double>(logit - *best));
  return {names[static_cast<std::size_t>(best - logits.values().begin())], 1 / sum};
}

void save_classifier(const OutputPath& output, const TextureClassifier& network,
                     const ClassifierSettings& settings, const std::vector<std::string>& names) {
  const nlohmann::ordered_json json = {
      {"height", settings.height}, {"width", settings.width}, {"names", joined(names)}};
  write_checkpoint(output, network.parameters(), {{"kind", kKind}, {"settings", json.dump()}});
}

NamedClassifier load_classifier(const std::string& path) {
  const SafetensorsFile file = read_checkpoint(path);
  const std::string kind = value_or(file.metadata(), "kind", "checkpoint");
  if (kind != kKind)
    throw std::runtime_error(path + ": is a " + in_quotes(kind) +
                             ", expected a classifier as supertac-classify --out writes it");
  JsonObject settings(file.metadata(), path, "settings");
  NamedClassifier loaded;
  loaded.names = comma_list(settings.text("names"));
  loaded.settings = {.height = settings.integer("height"),
                     .width = settings.integer("width"),
                     .classes = static_cast<Dim>(loaded.names.size())};
  Rng rng = Rng::zeros();
  try {
    loaded.network = std::make_unique<TextureClassifier>(loaded.settings, rng);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
  load_parameters(file, path, loaded.network->parameters());
  return loaded;
}

}  // namespace supertac
