#include "models/training/audit/step_difference.h"

#include <array>
#include <bit>
#include <stdexcept>

namespace supertac {

using Json = nlohmann::ordered_json;

std::optional<Dim> first_different_entry(const Tensor& one, const Tensor& other) {
  const auto bits = [](real x) { return std::bit_cast<std::array<std::byte, sizeof(real)>>(x); };
  for (Dim i = 0; one.size() == other.size() && i < one.size(); ++i)
    if (bits(one.data()[i]) != bits(other.data()[i])) return i;
  return std::nullopt;
}

std::optional<OperatorDifference> first_difference(const Json& one, const Json& other) {
  const auto refuse = [](const std::string& what) {
    throw std::invalid_argument("opened steps: expected two of the same network and recipe, found " + what);
  };
  if (one.size() != other.size())
    refuse(std::to_string(one.size()) + " and " + std::to_string(other.size()) + " operators");
  for (std::size_t i = 0; i < one.size(); ++i) {
    const Json &a = one[i], &b = other[i];
    const std::string name = a.at("name"), op = a.at("op");
    if (name != b.at("name")) refuse(name + " and " + b.at("name").get<std::string>());
    const auto settings_of = [](const Json& ran) {
      return ran.contains("settings") ? ran["settings"].dump() : "";
    };
    for (const char* field : {"inputs", "outputs"}) {
      const Json none = Json::array();
      const Json &x = a.contains(field) ? a[field] : none, &y = b.contains(field) ? b[field] : none;
      if (x.size() != y.size()) refuse(name + " with other " + field);
      if (field == std::string("outputs") && settings_of(a) != settings_of(b))
        return OperatorDifference{name, op, "the settings", settings_of(a), settings_of(b)};
      for (std::size_t k = 0; k < x.size(); ++k)
        if (x[k] != y[k])
          return OperatorDifference{
              name, op, (field == std::string("inputs") ? "input " : "output ") + std::to_string(k), x[k],
              y[k]};
    }
  }
  return std::nullopt;
}

}  // namespace supertac
