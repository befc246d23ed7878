#include "models/training/recipe.h"

#include <cmath>
#include <stdexcept>

#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/files/model_file.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

void require(bool holds, const char* argument, const char* expected, double found) {
  if (!holds) throw std::invalid_argument(refusal("recipe", argument, expected, format(found)));
}

void read_training(JsonObject entry, Recipe& r) {
  r.epochs = entry.integer("epochs");
  r.batch = entry.integer("batch");
  r.learning_rate = entry.number("learning_rate");
  r.warm_up = entry.number("warm_up");
  r.clip_norm = entry.number("clip_norm");
  r.muon = entry.text("optimizer", "adam") == "muon";
  r.loss = {entry.number("a"), entry.number("beta"), entry.number("lambda")};
  r.augment = {.lift = entry.number("lift"),
               .gain = entry.number("gain"),
               .taxel_gain = entry.number("taxel_gain"),
               .offset = entry.number("offset"),
               .noise = entry.number("noise"),
               .dropped = entry.integer("dropped")};
  if (entry.flag("mirror", false))
    throw FileError(entry.where(), "trained with --augment mirror, which is gone: draw with it, train anew");
  r.keeps_best = entry.flag("keeps_best", false);
  r.sampling = entry.flag("sampling", true);
}

}  // namespace

void Recipe::check() const {
  require(epochs >= 1 && epochs <= 100'000, "epochs", "1 to 100000", static_cast<double>(epochs));
  require(batch >= 1 && batch <= 4096, "batch", "1 to 4096", static_cast<double>(batch));
  require(learning_rate > 0 && learning_rate <= 1, "learning_rate", "more than 0 and at most 1",
          learning_rate);
  require(warm_up >= 0 && warm_up < 1, "warm_up", "a share of all steps, 0 to below 1", warm_up);
  require(clip_norm >= 0 && std::isfinite(clip_norm), "clip_norm", "0 (never) or more", clip_norm);
  model.check();
  loss.check();
  require(rate_hz >= 20 && rate_hz <= 2000, "rate_hz", "20 to 2000", rate_hz);
  require(delay_s >= 0 && delay_s * rate_hz < static_cast<double>(model.timesteps) - 0.5, "delay_s",
          "0 to less than the window lasts", delay_s);
  require(stride >= 1 && stride <= 100'000, "stride", "1 to 100000", static_cast<double>(stride));
  require(random_plates >= 0 && random_plates <= 50'000, "random_plates", "0 to 50000",
          static_cast<double>(random_plates));
  const PixelInterval interval = interval_factor.value_or(PixelInterval{});
  if (!PixelInterval::read(interval.text()))
    throw std::invalid_argument(refusal("recipe", "interval_factor",
                                        "X,Y,Z with X from 0 to 10, Y from 0.05 to 100 and Z from 0 to 4096",
                                        interval.text()));
  if (range) require(std::abs(range->span) > 1e-6, "range", "a span that is not 0", range->span);
  if (per_window && model.timesteps == 1)
    throw std::invalid_argument(
        "recipe: single frames (timesteps 1) say nothing of their own rest and gain; give --scaling fixed, "
        "or "
        "--preset frame");
  if (!leave_out.empty() && split != SplitKind::texture && split != SplitKind::group)
    throw std::invalid_argument("--leave-out needs --split texture or group, found --split " +
                                name_of(split));
}

Recipe Recipe::named(const std::string& name) {
  constexpr double kWindowS = 2.56;
  Recipe r;
  r.model = SuperTacSettings::of_preset(name);
  if (name == "frame") {
    r.rate_hz = 100;  // of no meaning
    r.per_window = false;
    r.keeps_best = true;
    r.learning_rate = 2e-3;
    return r;
  }
  r.rate_hz = static_cast<double>(r.model.timesteps) / kWindowS;
  r.augment = kStandardAugmentation;
  if (name == "tiny") {
    r.epochs = 80;
    r.learning_rate = 2e-3;
  }
  return r;
}

std::string training_text(const Recipe& r) {
  Json json{{"epochs", r.epochs},   {"batch", r.batch},
            {"seed", r.seed},       {"learning_rate", r.learning_rate},
            {"warm_up", r.warm_up}, {"clip_norm", r.clip_norm}};
  if (r.muon) json["optimizer"] = "muon";
  json.update({{"a", r.loss.a},
               {"beta", r.loss.beta},
               {"lambda", r.loss.lambda},
               {"lift", r.augment.lift},
               {"gain", r.augment.gain},
               {"taxel_gain", r.augment.taxel_gain},
               {"offset", r.augment.offset},
               {"noise", r.augment.noise},
               {"dropped", r.augment.dropped}});
  if (r.keeps_best) json["keeps_best"] = true;
  if (!r.sampling) json["sampling"] = false;
  return json.dump();
}

std::map<std::string, std::string> metadata_of(const Recipe& r) {
  std::map<std::string, std::string> entries = {{"training", training_text(r)},
                                                {"split", name_of(r.split)},
                                                {"seed", std::to_string(r.seed)},
                                                {"plates", joined(r.plates)},
                                                {"stride", std::to_string(r.stride)}};
  if (r.interval_factor) entries["interval_factor"] = r.interval_factor->text();
  if (!r.leave_out.empty()) entries["leave_out"] = joined(r.leave_out);
  if (r.random_plates > 0) entries["random_plates"] = std::to_string(r.random_plates);
  return entries;
}

Recipe Recipe::of(const ModelFile& file) {
  const std::string& path = file.path;
  const auto entry = [&](const char* key) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end())
      throw std::runtime_error(path + ": does not say its " + key + "; it was trained by an older version");
    return found->second;
  };
  const auto whole = [&](const char* key, const std::string& text) {
    const auto number = parse_uint(text);
    if (!number)
      throw std::runtime_error(path + ": " + key + " expects a whole number, found " + in_quotes(text));
    return *number;
  };
  Recipe r;
  r.model = file.model->settings();
  read_training({file.metadata, path, "training"}, r);
  r.seed = whole("seed", entry("seed"));
  r.stride = static_cast<std::int64_t>(whole("stride", entry("stride")));
  r.random_plates =
      static_cast<std::int64_t>(whole("random_plates", value_or(file.metadata, "random_plates", "0")));
  r.plates = comma_list(entry("plates"));
  r.leave_out = comma_list(value_or(file.metadata, "leave_out"));
  r.rate_hz = file.input.rate_hz;
  r.delay_s = file.input.delay_s;
  r.range = file.input.scaling;
  r.per_window = file.input.scaling.per_window;
  if (file.metadata.contains("interval_factor") && !file.metadata.contains("interval_factor_found"))
    r.interval_factor = file.interval();
  try {
    r.split = split_kind(entry("split"));
    r.check();
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
  return r;
}

}  // namespace supertac
