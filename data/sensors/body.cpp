// How an array is built: what a touch goes through on its way to the signals.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/sensors/sensor.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::pair<const char*, BodyShape> kShapes[] = {
    {"flat", BodyShape::flat}, {"dome", BodyShape::dome}, {"cylinder", BodyShape::cylinder}};

// Every number of a body: its key, and the least and most that it may be where it is not 0.
struct Number {
  const char* key;
  double Body::*member;
  double least, most;
};
constexpr Number kNumbers[] = {{"radius_mm", &Body::radius_mm, 1, 1e4},
                               {"skin_mm", &Body::skin_mm, 0.01, 100},
                               {"taxel_mm", &Body::taxel_mm, 0.01, 100},
                               {"crosstalk_rows", &Body::crosstalk_rows, -1, 10},
                               {"crosstalk_columns", &Body::crosstalk_columns, -1, 10},
                               {"hysteresis_s", &Body::hysteresis_s, 1e-4, 100},
                               {"creep", &Body::creep, -0.9, 10},
                               {"creep_s", &Body::creep_s, 1e-3, 1e4},
                               {"noise", &Body::noise, 1e-9, 1},
                               {"knee", &Body::knee, 0.01, 1000}};

constexpr BodyNumber kFitted[] = {{"skin_mm", &Body::skin_mm},
                                  {"knee", &Body::knee},
                                  {"crosstalk_rows", &Body::crosstalk_rows},
                                  {"crosstalk_columns", &Body::crosstalk_columns},
                                  {"hysteresis_s", &Body::hysteresis_s},
                                  {"creep", &Body::creep},
                                  {"creep_s", &Body::creep_s},
                                  {"noise", &Body::noise}};

// What is left of a difference after a time.
double left(double seconds, double constant_s) {
  return constant_s > 0 ? same_bits::exp(-seconds / constant_s) : 0;
}

}  // namespace

Body Body::of_rig() { return {.shape = BodyShape::dome, .radius_mm = 47, .skin_mm = 4.54}; }

Body Body::usual(const TaxelArray& array) { return array == TaxelArray{} ? of_rig() : Body{}; }

double Body::depth_mm(double x_mm, double y_mm) const {
  if (shape == BodyShape::flat) return 0;
  const double curvature = 1 / (2 * radius_mm);
  return curvature * (x_mm * x_mm + (shape == BodyShape::dome ? y_mm * y_mm : 0));
}

double Body::sigma_mm() const {
  const double skin = skin_mm / 2;
  return taxel_mm > 0 ? std::sqrt(skin * skin + taxel_mm * taxel_mm / 12) : skin;
}

void Body::check() const {
  const auto expect = [](bool good, const std::string& key, const std::string& expected, double found) {
    if (!good)
      throw std::invalid_argument("\"body." + key + "\" must be " + expected + ", found " + format(found));
  };
  for (const auto& [key, pointer, least, most] : kNumbers) {
    const double value = this->*pointer;
    expect(value == 0 || (value >= least && value <= most), key, format(least) + " to " + format(most),
           value);
  }
  expect(shape == BodyShape::flat ? radius_mm == 0 : radius_mm > 0, "radius_mm",
         "given where the shape is dome or cylinder, and nowhere else", radius_mm);
  expect(knee > 0 || !uncertainty.contains("knee"), "knee", "given where its uncertainty is", knee);
  expect((creep == 0) == (creep_s == 0), "creep_s", "given with creep, and not without", creep_s);
  for (const auto& [key, deviation] : uncertainty) {
    const auto known = [&key = key](const BodyNumber& number) { return key == number.key; };
    if (std::ranges::none_of(kFitted, known))
      throw std::invalid_argument("\"body.uncertainty\" must name what a fit finds (" +
                                  joined(kFitted, ", ", [](const BodyNumber& n) { return n.key; }) +
                                  "), found " + in_quotes(key));
    expect(std::isfinite(deviation) && deviation >= 0, "uncertainty." + key, "a standard deviation",
           deviation);
  }
}

std::span<const BodyNumber> fitted_numbers() { return kFitted; }

BodyResponse::BodyResponse(const Body& body, const TaxelArray& array) : body_(body), array_(array) {}

bool BodyResponse::neutral() const {
  return body_.knee == 0 && body_.crosstalk_rows == 0 && body_.crosstalk_columns == 0 &&
         body_.hysteresis_s == 0 && body_.creep == 0;
}

void BodyResponse::operator()(double period_s, std::span<double> shares) {
  if (neutral()) return;
  const std::size_t signals = shares.size();
  if (load_.empty()) {
    load_.assign(shares.begin(), shares.end());
    crept_ = load_;
  }
  const double held = left(period_s, body_.hysteresis_s), young = left(period_s, body_.creep_s);
  const double knee = body_.knee;
  for (std::size_t s = 0; s < signals; ++s) {
    const double load = shares[s];
    load_[s] = std::abs(load) >= std::abs(load_[s]) ? load : load + (load_[s] - load) * held;
    crept_[s] = load_[s] + (crept_[s] - load_[s]) * young;
    const double stood = load_[s] + body_.creep * crept_[s];
    shares[s] = knee > 0 ? stood * (1 + knee) / (std::abs(stood) + knee) : stood;
  }
  if (body_.crosstalk_rows == 0 && body_.crosstalk_columns == 0) return;
  const auto columns = static_cast<std::size_t>(array_.columns), rows = static_cast<std::size_t>(array_.rows),
             channels = static_cast<std::size_t>(array_.channels);
  for (std::size_t channel = 0; channel < channels; ++channel) {
    const auto place = [&](std::size_t r, std::size_t c) { return (r * columns + c) * channels + channel; };
    std::vector<double> of_row(rows), of_column(columns);
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < columns; ++c) {
        of_row[r] += shares[place(r, c)] / static_cast<double>(columns);
        of_column[c] += shares[place(r, c)] / static_cast<double>(rows);
      }
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < columns; ++c)
        shares[place(r, c)] += body_.crosstalk_rows * of_row[r] + body_.crosstalk_columns * of_column[c];
  }
}

Json json_of(const Body& body) {
  Json json;
  for (const auto& [word, shape] : kShapes)
    if (shape == body.shape) json["shape"] = word;
  for (const auto& [key, pointer, least, most] : kNumbers)
    if (body.*pointer != 0) json[key] = body.*pointer;
  for (const auto& [key, deviation] : body.uncertainty) json["uncertainty"][key] = deviation;
  return json;
}

Body body_of(JsonObject keys) {
  Body body;
  body.shape = keys.one_of("shape", kShapes, "flat");
  for (const auto& [key, pointer, least, most] : kNumbers) body.*pointer = keys.number(key, 0);
  if (const Json* uncertainty = keys.find("uncertainty")) {
    if (!uncertainty->is_object()) keys.wrong("uncertainty", "an object {key: number}", *uncertainty);
    for (const auto& [key, deviation] : uncertainty->items()) {
      if (!deviation.is_number()) keys.wrong("uncertainty", "an object {key: number}", *uncertainty);
      body.uncertainty[key] = deviation.get<double>();
    }
  }
  keys.no_others();
  try {
    body.check();
  } catch (const std::invalid_argument& error) {
    throw FileError(keys.where(), error.what());
  }
  return body;
}

}  // namespace supertac
