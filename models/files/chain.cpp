#include "models/files/exports.h"

#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/text.h"
#include "models/inference/compiled/integer_plan.h"

namespace supertac {
namespace {

constexpr std::string_view kOfInt8 = "int8.";

void add_text(Sha256& sum, const std::string& text) {
  sum.add(text);
  sum.add(std::string_view("", 1));
}

template <class T>
void add(Sha256& sum, const std::vector<T>& values) {
  sum.add(std::as_bytes(std::span(values)));
}

void add_tensors(Sha256& sum, const SafetensorsFile& file, bool of_int8) {
  for (const auto& [name, info] : file.tensors()) {
    if (name.starts_with(kOfInt8) != of_int8) continue;
    add_text(sum, name);
    sum.add(file.bytes(name));
  }
}

ChainLink int8_link(const SafetensorsFile& file, const ModelFile& model) {
  Sha256 sum;
  add_tensors(sum, file, true);
  const auto plan = IntegerPlan::of(*model.model, model.int8_ranges());
  for (const IntegerStep& s : plan->steps) {
    add_text(sum, s.name);
    add(sum, s.weights);
    std::vector<std::int32_t> offsets, multipliers, shifts;
    for (const c99::outcome& o : s.outcomes)
      offsets.push_back(o.offset), multipliers.push_back(o.multiplier), shifts.push_back(o.shift);
    for (const auto* all : {&offsets, &multipliers, &shifts}) add(sum, *all);
    const auto& n = s.numbers;
    add(sum, n.size() < 3 ? std::vector{1, 0, 0} : std::vector(n.end() - 3, n.end()));  // multiplier, ...
    add(sum, std::vector<std::int32_t>{s.weights.empty() ? IntegerStep::kNoSlope : s.product.slope});
  }
  return {"int8", sum.hex()};
}

}  // namespace

std::vector<ChainLink> chain_of(const SafetensorsFile& file) {
  std::vector<ChainLink> chain;
  auto metadata = file.metadata();
  const nlohmann::ordered_json made = parse_json_limited(value_or(metadata, kProvenanceKey, "{}"));
  const auto parents = made.value("parents", nlohmann::ordered_json::object());
  if (parents.contains("recordings"))
    chain.push_back({"recordings", parents["recordings"].get<std::string>()});
  metadata.erase(kProvenanceKey), metadata.erase("checksum");
  Sha256 recipe, tensors;
  for (const auto& [key, text] : metadata) add_text(recipe, key), add_text(recipe, text);
  add_tensors(tensors, file, false);
  chain.push_back({"recipe", recipe.hex()});
  chain.push_back({"model", tensors.hex()});
  return chain;
}

CCode exported(const SafetensorsFile& file, const std::string& name, double sensor_hz) {
  const ModelFile model = model_of(file);
  std::vector<ChainLink> chain = chain_of(file);
  chain.push_back(int8_link(file, model));
  return c_code_of(model, name, sensor_hz > 0 ? sensor_hz : model.input.rate_hz, std::move(chain));
}

}  // namespace supertac
