#include "apps/train/report.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "apps/train/run_folder.h"
#include "apps/web/chart.h"
#include "apps/web/result_page.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using Value = std::optional<double> (*)(const LogLine&);

ChartSeries curve(const char* name, const std::vector<LogLine>& lines, Value value) {
  ChartSeries series{.name = name, .points = {}};
  for (const LogLine& line : lines)
    if (const auto y = value(line)) series.points.emplace_back(static_cast<double>(line.step), *y);
  series.dots = series.points.size() < 40;
  return series;
}

// Training and test in one plot; again as the distance from 1 on logarithmic axes, where late gains show.
std::string learning_curves(const std::vector<LogLine>& lines) {
  const ChartAxis step{.label = "step"};
  const auto logarithmic = [](const char* label) { return ChartAxis{.label = label, .logarithmic = true}; };
  return "<div class=\"two\">" +
         chart_svg("SSIM, linear axes", step, {.label = "SSIM", .most = 1},
                   {curve("training pictures", lines, [](const LogLine& l) { return std::optional(l.ssim); }),
                    curve("test pictures in contact", lines, [](const LogLine& l) { return l.test_ssim; })}) +
         chart_svg(
             "1 - SSIM, logarithmic axes", logarithmic("step"), logarithmic("1 - SSIM"),
             {curve("training pictures", lines, [](const LogLine& l) { return std::optional(1 - l.ssim); }),
              curve("test pictures in contact", lines,
                    [](const LogLine& l) {
                      return l.test_ssim ? std::optional(1 - *l.test_ssim) : std::nullopt;
                    })}) +
         "</div>";
}

struct Other {
  const char* title;
  Value value;
  bool logarithmic;
};
constexpr Other kOthers[] = {
    {"Loss", [](const LogLine& l) { return std::optional(l.total); }, true},
    {"Mean squared error of the pictures", [](const LogLine& l) { return std::optional(l.l2); }, true},
    {"Reconstruction error of the VAEs", [](const LogLine& l) { return std::optional(l.reconstruction); },
     true},
    {"Kullback-Leibler divergence", [](const LogLine& l) { return std::optional(l.kld); }, false},
    {"PSNR of test pictures in contact, dB", [](const LogLine& l) { return l.test_psnr_db; }, false},
    {"Gradient norm before clipping", [](const LogLine& l) { return std::optional(l.gradient_norm); }, true}};

// {"model": {"latent": 10}} as the rows model latent | 10; lists of words or numbers on one line.
void add_facts(std::vector<std::pair<std::string, std::string>>& facts, const std::string& name,
               const nlohmann::ordered_json& value) {
  const auto words = [](std::string text) {
    if (text == "spread") return std::string("predicted error");  // the key of old files
    std::ranges::replace(text, '_', ' ');
    return text;
  };
  if (value.is_object()) {
    for (const auto& [key, part] : value.items())
      add_facts(facts, (name.empty() ? "" : name + " ") + words(key), part);
  } else if (value.is_array()) {
    facts.emplace_back(name, joined(value, ", ", [](const nlohmann::ordered_json& part) {
                         return part.is_string() ? part.get<std::string>() : part.dump();
                       }));
  } else if (value.is_boolean()) {
    facts.emplace_back(name, value.get<bool>() ? "yes" : "no");
  } else {
    facts.emplace_back(name, value.is_string()         ? value.get<std::string>()
                             : value.is_number_float() ? format(value.get<double>())
                                                       : value.dump());
  }
}

}  // namespace

std::string report_page(const nlohmann::ordered_json& settings, const std::vector<LogLine>& lines) {
  std::string others;
  for (const Other& other : kOthers)
    others += chart_svg(other.title, {.label = "step"}, {.label = "", .logarithmic = other.logarithmic},
                        {curve("", lines, other.value)});
  std::vector<std::pair<std::string, std::string>> facts;
  nlohmann::ordered_json once = settings;
  if (once.contains("provenance"))
    for (const auto& [name, value] : settings.items()) once["provenance"].erase(name);
  add_facts(facts, "", once);
  return result_page(
      "SuperTac training",
      page_section("Learning curves",
                   "training pictures are augmented and of whole passes, test pictures those in contact",
                   learning_curves(lines)) +
          page_section("Other curves", "means over the steps since the point before",
                       "<div class=\"two\">" + others + "</div>") +
          page_section("Settings", "", page_facts(facts)));
}

}  // namespace supertac
