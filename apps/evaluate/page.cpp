#include "apps/evaluate/page.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/evaluate/score_tables.h"
#include "apps/web/result_page.h"
#include "io/images/images.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kApartMm = 3;
constexpr std::uint32_t kApartFrames = 20;
constexpr float kTexture = 0.1F;
constexpr int kPanel = 64;  // pixels of a PNG's longer side

std::string cell_of(const nlohmann::ordered_json& value, int decimals, double factor = 1) {
  return "<td>" + (value.is_number() ? format(factor * value.get<double>(), decimals) : "-") + "</td>";
}

std::string method_row(const std::string& name, const nlohmann::ordered_json& scores,
                       const nlohmann::ordered_json& latency) {
  const auto& contact = scores["contact"];
  const auto& all = scores["all"];
  return std::string(name == "network" ? "<tr class=\"own\">" : "<tr>") + "<td>" + escaped(name) + "</td>" +
         cell_of(contact["ssim"], 3) + cell_of(contact["psnr_mean_db"], 2) +
         cell_of(contact["position_error_mm"], 2) + cell_of(all["ssim"], 3) +
         cell_of(all["psnr_mean_db"], 2) + cell_of(latency["median_us"], 1) + "</tr>";
}

std::string by_method(const nlohmann::ordered_json& result) {
  std::string rows = method_row("network", result, result["latency"]["network"]);
  for (const auto& [name, scores] : result["baselines"].items())
    rows += method_row(name, scores, result["latency"][name]);
  return page_section("Scores beside the baselines",
                      result.contains("contact_level") ? "contact windows: something presses the array"
                                                       : "contact windows: some texture lies under the array",
                      page_table({"method", "contact SSIM", "PSNR dB", "position mm", "all SSIM", "PSNR dB",
                                  "one picture, us"},
                                 rows));
}

std::string by_zone(const nlohmann::ordered_json& result) {
  std::string rows;
  const bool measured = result.contains("contact_level");
  for (const char* zone : {"contact", "edge", "flat", "air", "all"}) {
    if (!result.contains(zone) || (measured && std::string(zone) == "air")) continue;
    const auto& m = result[zone];
    rows += std::string("<tr><td>") + (measured && std::string(zone) == "flat" ? "rest" : zone) + "</td>" +
            cell_of(m["windows"], 0) + cell_of(m["ssim"], 3) + cell_of(m["psnr_mean_db"], 2) +
            cell_of(m.value("ghost_rate", nlohmann::ordered_json()), 2, 100) +
            cell_of(m.value("miss_rate", nlohmann::ordered_json()), 2, 100) + "</tr>";
  }
  if (measured)
    return page_section(
        "Contact, edge, rest",
        "contact: a pixel of the measured truth shows more than " +
            format(result["contact_level"].get<double>(), 3) +
            "; edge: it reaches the array's border; ghosts: pictures that show something at rest; "
            "misses: pictures that show nothing of a contact",
        page_table({"zone", "windows", "SSIM", "PSNR dB", "ghosts %", "misses %"}, rows));
  return page_section(
      "Contact, flat plate, air",
      "ghosts: pictures that show a texture where the plate is flat; misses: pictures that "
      "show nothing of one; windows beside a texture, within 3 mm of it, count among all only",
      page_table({"zone", "windows", "SSIM", "PSNR dB", "ghosts %", "misses %"}, rows));
}

std::string by_height(const nlohmann::ordered_json& trust) {
  if (!trust.contains("coverage_of")) return "";
  std::string rows;
  for (const auto& [name, held] : trust["coverage_of"].items())
    rows += "<tr><td>" + name + "</td>" + cell_of(held["pixels"], 0) + cell_of(held["share"], 1, 100) +
            cell_of(held["half_width"], 3) + "</tr>";
  return page_section("Intervals", "nine pixels in ten of each height should lie within",
                      page_table({"pixels", "number", "within %", "half width"}, rows));
}

std::string by_element(const nlohmann::ordered_json& result) {
  if (!result.contains("map")) return "";
  std::vector<std::string> head = {"map"};
  std::string rows;
  for (const auto& [name, surface] : result["map"]["surfaces"].items()) {
    for (const auto& e : surface.value("elements", nlohmann::ordered_json::array())) {
      head.resize(1);
      rows += "<tr><td>" + escaped(name) + "</td>";
      for (const auto& [key, value] : e.items()) head.push_back(key), rows += cell_of(value, 2);
      rows += "</tr>";
    }
  }
  return page_section("Elements", "that the maps of all passes of a plate and trial show",
                      page_table(head, rows));
}

std::string by_distance(const nlohmann::ordered_json& parts) {
  if (parts.empty()) return "";  // nothing slid
  std::string rows;
  for (const auto& part : parts)
    rows += "<tr><td>" + format(part["from_mm"].get<double>()) + "</td>" + cell_of(part["windows"], 0) +
            cell_of(part["ssim"], 3) + cell_of(part["psnr_mean_db"], 2) + "</tr>";
  return page_section(
      "By distance since the first contact",
      "a texture cannot be known before its second element is under the array; contact windows",
      page_table({"slid from, mm", "windows", "SSIM", "PSNR dB"}, rows));
}

std::string png_of(std::span<const float> values, int rows, int columns) {
  const int longer = std::max(rows, columns);
  Picture picture(kPanel * columns / longer, kPanel * rows / longer);
  draw_panel(picture, {0, 0, picture.width, picture.height}, values, rows, columns);
  return picture_address(picture);
}

}  // namespace

void EvaluationPage::add(const Drawn& d, double ssim) {
  const auto texture = std::count_if(d.target.begin(), d.target.end(), [](float v) { return v > kTexture; });
  contact_.push_back({ssim, d.example, 4 * static_cast<std::size_t>(texture) >= d.target.size()});
}

std::vector<EvaluationPage::ScoredWindow> EvaluationPage::extremes(bool best, const std::string& group,
                                                                   std::size_t most) const {
  std::vector<ScoredWindow> sorted, chosen;
  for (const ScoredWindow& one : contact_)
    if (group.empty() || group_of(windows_.passes()[windows_.pass_of(one.window)]) == group)
      sorted.push_back(one);
  std::sort(sorted.begin(), sorted.end(), [&](const ScoredWindow& a, const ScoredWindow& b) {
    return std::pair(best ? -a.ssim : a.ssim, a.window) < std::pair(best ? -b.ssim : b.ssim, b.window);
  });
  const auto near = [&](const ScoredWindow& a, const ScoredWindow& b) {
    return windows_.pass_of(a.window) == windows_.pass_of(b.window) &&
           (windows_.truth_is_measured(windows_.pass_of(a.window))
                ? std::max(a.window, b.window) - std::min(a.window, b.window) < kApartFrames
                : std::abs(windows_.position(a.window).y_mm - windows_.position(b.window).y_mm) < kApartMm);
  };
  for (const ScoredWindow& one : sorted) {
    if (chosen.size() == most) break;
    if (best && !one.full) continue;  // the edge of a texture is drawn well too easily
    if (std::none_of(chosen.begin(), chosen.end(), [&](const ScoredWindow& c) { return near(c, one); }))
      chosen.push_back(one);
  }
  return chosen;
}

std::string EvaluationPage::name_of(std::uint32_t window) const {
  const WindowSet::Pass& pass = windows_.passes()[windows_.pass_of(window)];
  return (group_of(pass) == pass.plate ? "" : pass.group + ", ") + pass.plate + ", trial " +
         std::to_string(pass.trial) + ", pass " + std::to_string(pass.pass) +
         (pass.speed_mm_s > 0 ? ", " + format(pass.speed_mm_s) + " mm/s" : "");
}

std::string EvaluationPage::by_group(const nlohmann::ordered_json& groups) const {
  const bool grouped = has_groups(windows_);
  std::string rows;
  for (const auto& m : groups)
    rows += "<tr><td>" + escaped(m["name"].get<std::string>()) + "</td>" +
            cell_of(m["contact"]["windows"], 0) + cell_of(m["contact"]["ssim"], 3) +
            cell_of(m["contact"]["psnr_mean_db"], 2) + cell_of(m["contact"]["position_error_mm"], 2) +
            cell_of(m["all"]["ssim"], 3) + "</tr>";
  return page_section(
      grouped ? "By group" : "By plate", "the worst first",
      page_table({grouped ? "group" : "plate", "contact", "SSIM", "PSNR dB", "position mm", "all SSIM"},
                 rows));
}

std::string EvaluationPage::shown(const std::string& title, const std::string& note,
                                  const std::vector<ScoredWindow>& chosen,
                                  const std::map<std::uint32_t, ShownWindow>& pictures) const {
  if (chosen.empty()) return "";
  const TaxelArray array = windows_.array();
  const ImageGrid grid = windows_.image();
  std::string cards = "<div class=\"windows\">";
  for (const auto& [score, window, full] : chosen) {
    const ShownWindow& p = pictures.at(window);
    std::vector<float> difference;
    for (std::size_t i = 0; i < p.drawn.size(); ++i) difference.push_back(std::abs(p.drawn[i] - p.truth[i]));
    const std::string name = name_of(window) + ", " + windows_.place_text(window);
    cards += "<figure class=\"window\"><p>" + escaped(name) + "<br>SSIM " + format(score, 3) + ", PSNR " +
             format(psnr_db(mean_squared_error(p.drawn, p.truth)), 1) + " dB</p><div>";
    const auto add = [&](const char* what, std::span<const float> values, int rows, int columns) {
      cards += "<span><img alt=\"" + std::string(what) + ", " + escaped(name) + "\" src=\"" +
               png_of(values, rows, columns) + "\">" + what + "</span>";
    };
    add("felt", p.input, array.rows, array.columns);
    add("drawn", p.drawn, grid.height, grid.width);
    add("true", p.truth, grid.height, grid.width);
    add("difference", difference, grid.height, grid.width);
    cards += "</div></figure>";
  }
  return page_section(title, note, cards + "</div>");
}

std::string EvaluationPage::html(const Ensemble& network, const nlohmann::ordered_json& result,
                                 const std::vector<std::pair<std::string, std::string>>& made_by) const {
  const std::vector<ScoredWindow> best = extremes(true), worst = extremes(false);
  std::vector<ScoredWindow> of_groups;
  const std::size_t groups = result["groups"].size();
  for (std::size_t i = 0; i < std::min(groups, kGroups) && groups > 1; ++i)
    std::ranges::copy(extremes(false, result["groups"][i]["name"].get<std::string>(), kOfGroup),
                      std::back_inserter(of_groups));
  std::vector<std::uint32_t> chosen;
  for (const std::vector<ScoredWindow>* some : {&best, &worst, &std::as_const(of_groups)})
    for (const ScoredWindow& one : *some) chosen.push_back(one.window);
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::map<std::uint32_t, ShownWindow> pictures;
  std::vector<ShownWindow> shown_again = draw_again(network, windows_, chosen, {});
  for (std::size_t i = 0; i < chosen.size(); ++i) pictures[chosen[i]] = std::move(shown_again[i]);

  std::string content = "<p class=\"quiet\">" + escaped(result["model"].get<std::string>()) + ", split " +
                        escaped(result["split"].get<std::string>()) + ", " +
                        std::to_string(result["all"]["windows"].get<long>()) + " windows, " +
                        std::to_string(result["contact"]["windows"].get<long>()) + " in contact</p>";
  content += by_method(result) + "<div class=\"two\">" + by_group(result["groups"]) + by_zone(result) +
             "</div>" + by_height(result["trust"]) + by_distance(result["felt"]) + by_element(result) +
             shown("The worst of each", "the groups in the order of their scores", of_groups, pictures) +
             shown("The worst windows", "in contact, by SSIM; no two within 3 mm of one pass, or 20 frames",
                   worst, pictures) +
             shown("The best windows", "of those with something on a quarter of the picture", best, pictures);
  content += page_section("What made this page", "", page_facts(made_by));
  return result_page("SuperTac evaluation", content);
}

}  // namespace supertac
