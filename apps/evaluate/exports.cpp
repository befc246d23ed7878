#include "apps/evaluate/exports.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "apps/web/pages.h"
#include "data/windows/split.h"
#include "io/files/safetensors.h"
#include "io/images/images.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kStrips = 12, kFilmColumns = 24;

// What people are shown of a window: the last frame's taxels, the picture, the truth, and half the width of
// each pixel's 90 % interval, of which there is none where the network has none.
constexpr const char* kParts[] = {"felt", "drawn", "true", "off by"};
using ShownWindow = std::array<std::vector<float>, std::size(kParts)>;

// The windows `chosen`, drawn once more.
std::vector<ShownWindow> draw_again(const Ensemble& network, const WindowSet& windows,
                                    std::span<const std::uint32_t> chosen, const PixelInterval& interval) {
  std::vector<ShownWindow> shown;
  for_each_output(network, windows, chosen, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < b.size(); ++n) {
      const auto drawn = b.output(n), truth = b.target(n);
      std::vector<float> half_widths;
      interval.with_load(network.first().format(), b.input(n), b.predicted_error(n), half_widths);
      interval.half_widths(drawn, windows.image().width, half_widths, half_widths);
      shown.push_back({mean_of_channels(windows.array(), windows.shown_frame(chosen[b.first + n])),
                       {drawn.begin(), drawn.end()},
                       {truth.begin(), truth.end()},
                       half_widths});
    }
    return true;
  });
  return shown;
}

// Each window's parts, with headings, units and a colour bar. `down`: windows stand below each other, else
// side by side.
Picture drawing_of(const std::vector<ShownWindow>& shown, std::span<const std::uint32_t> chosen,
                   const WindowSet& windows, int side, bool down, const std::string& title) {
  const TaxelArray& array = windows.array();
  const ImageGrid image = windows.image();
  const int parts = shown.empty() || shown.front()[3].empty() ? 3 : 4, count = static_cast<int>(shown.size());
  std::vector<PanelValues> panels;
  for (int i = 0; i < count * parts; ++i) {
    const auto window = static_cast<std::size_t>(down ? i / parts : i % count),
               part = static_cast<std::size_t>(down ? i % parts : i / count);
    const bool is_frame = part == 0;
    panels.push_back(
        {shown[window][part], is_frame ? array.rows : image.height, is_frame ? array.columns : image.width});
  }
  const Picture inside = panel_grid(panels, down ? parts : count, side);
  Captions captions{.title = title + "; a picture is " + format(image.width_mm()) + " x " +
                             format(image.height_mm()) + " mm",
                    .low = "0: nothing, not pressed",
                    .high = "1: the highest, pressed hard"};
  const auto middle = [](int pixels, int of, int i) { return pixels * (2 * i + 1) / (2 * of); };
  for (int i = 0; i < parts; ++i)
    (down ? captions.columns : captions.rows)
        .push_back({middle(down ? inside.width : inside.height, parts, i), kParts[i]});
  for (int i = 0; i < count; ++i) {
    const std::uint32_t window = chosen[static_cast<std::size_t>(i)];
    const WindowSet::Pass& pass = windows.passes()[windows.pass_of(window)];
    const std::string place = windows.place_text(window);  // of a film the pass is in the title
    if (down)
      captions.rows.push_back(
          {middle(inside.height, count, i),
           pass.plate + " t" + std::to_string(pass.trial) + " p" + std::to_string(pass.pass) + "\n" + place});
    else if (i % 3 == 0)
      captions.columns.push_back({middle(inside.width, count, i), place});
  }
  return captioned(inside, captions);
}

constexpr std::size_t kShown = 12, kGroups = 8, kOfGroup = 3;  // windows, groups, and windows of a group

// The best or worst that do not lie beside each other; of all groups, or of one.
std::vector<ContactScore> extremes(const WindowSet& windows, std::span<const ContactScore> scores, bool best,
                                   const std::string& group = {}, std::size_t most = kShown) {
  constexpr double kApartMm = 3;
  constexpr std::uint32_t kApartFrames = 20;
  std::vector<ContactScore> sorted, chosen;
  for (const ContactScore& one : scores)
    if (group.empty() || group_of(windows.passes()[windows.pass_of(one.window)]) == group)
      sorted.push_back(one);
  std::ranges::sort(sorted, {}, [best](const ContactScore& one) {
    return std::pair(best ? -one.ssim : one.ssim, one.window);
  });
  const auto near = [&](const ContactScore& a, const ContactScore& b) {
    return windows.pass_of(a.window) == windows.pass_of(b.window) &&
           (windows.truth_is_measured(windows.pass_of(a.window))
                ? std::max(a.window, b.window) - std::min(a.window, b.window) < kApartFrames
                : std::abs(windows.position(a.window).y_mm - windows.position(b.window).y_mm) < kApartMm);
  };
  for (const ContactScore& one : sorted) {
    if (chosen.size() == most) break;
    if (best && !one.is_full) continue;  // the edge of a texture is drawn well too easily
    if (std::ranges::none_of(chosen, [&](const ContactScore& c) { return near(c, one); }))
      chosen.push_back(one);
  }
  return chosen;
}

// With its group where that is another.
std::string name_of(const WindowSet::Pass& pass) {
  return (group_of(pass) == pass.plate ? "" : pass.group + ", ") + pass.plate + ", trial " +
         std::to_string(pass.trial) + ", pass " + std::to_string(pass.pass) +
         (pass.speed_mm_s > 0 ? ", " + format(pass.speed_mm_s) + " mm/s" : "");
}

Json windows_as_json(const std::vector<ContactScore>& chosen, const WindowSet& windows,
                     const Ensemble& network) {
  std::vector<std::uint32_t> which;
  for (const ContactScore& one : chosen) which.push_back(one.window);
  const std::vector<ShownWindow> pictures = draw_again(network, windows, which, {});
  auto json = Json::array();
  for (std::size_t i = 0; i < chosen.size(); ++i)
    json.push_back(
        {{"name", name_of(windows.passes()[windows.pass_of(which[i])]) + ", " + windows.place_text(which[i])},
         {"ssim", chosen[i].ssim},
         {"psnr_db", chosen[i].psnr_db},
         {"felt", levels_base64(pictures[i][0])},
         {"drawn", levels_base64(pictures[i][1])},
         {"true", levels_base64(pictures[i][2])}});
  return json;
}

}  // namespace

void OutputsFile::add(const Drawn& drawn) {
  const auto append = [](std::vector<float>& to, std::span<const float> values) {
    to.insert(to.end(), values.begin(), values.end());
  };
  append(input_, drawn.input), append(output_, drawn.pictures[0]);
  append(truth_, drawn.target), append(predicted_error_, drawn.predicted_error);
  const WindowSet::Position position = windows_.position(drawn.example);
  position_mm_.insert(position_mm_.end(), {position.x_mm, position.y_mm});
  pass_.push_back(static_cast<std::int64_t>(windows_.pass_of(drawn.example)));
}

void OutputsFile::write(const OutputPath& output) const {
  const auto bytes = [](const std::vector<float>& v) { return std::as_bytes(std::span(v)); };
  const std::uint64_t count = pass_.size();
  const std::vector<std::uint64_t> pictures{count, static_cast<std::uint64_t>(windows_.image().height),
                                            static_cast<std::uint64_t>(windows_.image().width)};
  std::vector<TensorToWrite> tensors{
      {"input", "F32", {count, windows_.frames(), windows_.array().signals()}, bytes(input_)},
      {"output", "F32", pictures, bytes(output_)},
      {"truth", "F32", pictures, bytes(truth_)},
      {"position_mm", "F64", {count, 2}, std::as_bytes(std::span(position_mm_))},
      {"pass", "I64", {count}, std::as_bytes(std::span(pass_))}};
  if (!predicted_error_.empty())
    tensors.push_back({"predicted_error", "F32", pictures, bytes(predicted_error_)});
  write_safetensors(output, {{"format", "supertac-outputs"}}, tensors);
}

void write_pictures(const Ensemble& model, const PixelInterval& interval, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder) {
  std::vector<std::uint32_t> touching;
  std::map<std::size_t, std::vector<std::uint32_t>> by_pass;
  for (const std::uint32_t i : test) {
    if (windows.contact(i)) touching.push_back(i);
    by_pass[windows.pass_of(i)].push_back(i);
  }
  const auto drawn = [&](const std::vector<std::uint32_t>& chosen, int side, bool down,
                         const std::string& title) {
    return drawing_of(draw_again(model, windows, chosen, interval), chosen, windows, side, down, title);
  };
  write_png(folder.add("strips.png"), drawn(evenly_spaced(touching.empty() ? test : touching, kStrips), 96,
                                            true, "Windows in contact"));
  for (const auto& [pass, list] : by_pass) {
    const WindowSet::Pass& p = windows.passes()[pass];
    const std::string name = p.plate + "_t" + std::to_string(p.trial) + "_p" + std::to_string(p.pass) + "_v" +
                             std::to_string(static_cast<int>(p.speed_mm_s));
    write_png(folder.add("film_" + name + ".png"),
              drawn(evenly_spaced(list, kFilmColumns), 48, false, name_of(p)));
  }
}

std::string evaluation_page(const Ensemble& network, const WindowSet& windows,
                            std::span<const ContactScore> scores, const Json& result,
                            const std::vector<std::pair<std::string, std::string>>& made_by) {
  std::vector<ContactScore> of_groups;
  const std::size_t groups = result["groups"].size();
  for (std::size_t i = 0; i < std::min(groups, kGroups) && groups > 1; ++i)
    std::ranges::copy(
        extremes(windows, scores, false, result["groups"][i]["name"].get<std::string>(), kOfGroup),
        std::back_inserter(of_groups));
  return result_page({{"title", "SuperTac evaluation"},
                      {"result", result},
                      {"made_by", made_by},
                      {"grouped", has_groups(windows)},
                      {"rows", windows.array().rows},
                      {"columns", windows.array().columns},
                      {"scale", windows.settings().scale},
                      {"colours", colour_map_base64()},
                      {"worst_of_groups", windows_as_json(of_groups, windows, network)},
                      {"worst", windows_as_json(extremes(windows, scores, false), windows, network)},
                      {"best", windows_as_json(extremes(windows, scores, true), windows, network)}});
}

namespace {

// Of a result; NaN or null where there is no figure.
double number(const Json& value) { return value.is_number() ? value.get<double>() : NAN; }
std::string figure(const Json& value, int decimals) { return format(number(value), decimals); }
std::string percent(const Json& share, int decimals = 1) {
  return format(100 * number(share), decimals) + " %";
}

std::string row(const std::string& name, const Json& scores, const Json& latency) {
  std::string line = left_aligned(name, 12);
  const auto add = [&](const Json& value, int decimals) {
    line += right_aligned(value.is_number() ? figure(value, decimals) : "-", 9);
  };
  const Json &contact = scores["contact"], &all = scores["all"];
  add(contact["ssim"], 3), add(contact["psnr_mean_db"], 2), add(contact["position_error_mm"], 2);
  add(all["ssim"], 3), add(all["psnr_mean_db"], 2), add(latency["median_us"], 1);
  return line;
}

/// The 95 % intervals of scores_by_pass(); empty where they are not known.
std::string interval_text(const Json& over_passes) {
  if (!over_passes.contains("ssim")) return "";
  const Json &ssim = over_passes["ssim"], &psnr = over_passes["psnr_mean_db"];
  return "SSIM " + figure(ssim[0], 3) + " to " + figure(ssim[1], 3) + ", PSNR " + figure(psnr[0], 2) +
         " to " + figure(psnr[1], 2) + " dB";
}

/// What was drawn where nothing is, and not drawn where something is.
void print_zones(const Arguments& a, const Json& result) {
  const char* where_nothing_is = result.contains("contact_level") ? "at rest" : "flat";
  for (const auto& [zone, name] : {std::pair("flat", where_nothing_is), {"air", "air"}})
    if (const Json& m = result[zone]; m["windows"] > 0)
      a.print(std::string(name) + ": " + percent(m["ghost_rate"], 2) + " of " + m["windows"].dump() +
              " pictures show what is not there, PSNR " + figure(m["psnr_mean_db"], 1) + " dB");
  if (result.contains("edge"))
    a.print("at the array's edge: SSIM " + figure(result["edge"]["ssim"], 3) + ", PSNR " +
            figure(result["edge"]["psnr_mean_db"], 2) + " dB, " + result["edge"]["windows"].dump() +
            " pictures");
  if (const Json& missed = result["contact"]["miss_rate"]; missed.is_number())
    a.print("in contact " + percent(missed, 2) + " show nothing of what is there");
}

/// The worst groups.
void print_groups(const Arguments& a, const Json& groups, const std::string& called) {
  constexpr std::size_t kMost = 8;
  std::size_t printed = 0;
  if (groups.size() < 2) return;
  for (const Json& group : groups) {
    if (printed == kMost)
      return a.print("... and " + std::to_string(groups.size() - kMost) + " more, better ones");
    const Json& contact = group["contact"];
    if (contact["windows"] == 0) continue;
    a.print(called + " " + group["name"].get<std::string>() + ": contact SSIM " + figure(contact["ssim"], 3) +
            ", PSNR " + figure(contact["psnr_mean_db"], 2) + " dB, " + contact["windows"].dump() +
            " windows");
    ++printed;
  }
}

/// What the network says of its own pictures.
void print_trust(const Arguments& a, const Json& trust) {
  if (trust.contains("coverage")) {
    a.print("intervals hold " + percent(trust["coverage"]) + " of the pixels (interval " +
            trust["interval"].get<std::string>() + "; " + trust["interval_found"].get<std::string>() +
            " would hold " + percent(IntervalCoverage::kCovered) + " at each height of the truth)");
    std::string truths;
    for (const auto& [truth, held] : trust["coverage_of"].items())
      truths += (truths.empty() ? "" : ", ") + truth.substr(5) + " " + percent(held["share"]) + " (+-" +
                figure(held["half_width"], 2) + ")";
    a.print("intervals hold by height of the truth: " + truths);
  }
  if (std::isfinite(number(trust["auroc"])))
    a.print("predicted errors tell an SSIM below " + format(TrustScores::kBadSsim) + " with an AUROC of " +
            figure(trust["auroc"], 3));
  if (trust.contains("unlike_training"))
    a.print(percent(trust["unlike_training"]) + " of the windows are unlike training");
}

void print_map(const Arguments& a, const Json& map, bool stated) {
  const Json &of_pass = map["of_pass"], &of_surface = map["of_surface"];
  if (!std::isfinite(number(of_pass["ssim"]))) return;  // no window in contact
  const auto text = [](const Json& scored) {
    const std::string interval = interval_text(scored["over_passes"]);
    return "SSIM " + figure(scored["ssim"], 3) + ", PSNR " + figure(scored["psnr_mean_db"], 2) + " dB" +
           (interval.empty() ? "" : " (95 % over passes: " + interval + ")");
  };
  a.print(std::string("in contact, read back from the map of the pass") +
          (stated ? ", elements drawn as stated: " : ": ") + text(of_pass) +
          "; from that of all passes: " + text(of_surface));
  const auto found = [](const Json& e) {
    return e["found"].dump() + " of " + e["existing"].dump() + ", " + e["false"].dump() + " false";
  };
  if (of_surface["elements"]["existing"] > 0)
    a.print("elements found within " + format(ElementScores::kFoundMm) +
            " mm: " + found(of_pass["elements"]) + " on maps of passes; " + found(of_surface["elements"]) +
            " on those of all passes");
}

// What a reader of the scores should know.
void warn_of(const Arguments& a, const Json& result, bool grouped) {
  constexpr double kHardly = 0.02, kCoin = 0.5;
  constexpr std::size_t kFew = 3;
  const auto warn = [&](const std::string& remark) { a.note("warning: " + remark); };
  const double own = number(result["contact"]["ssim"]),
               ridge = number(result["baselines"]["ridge"]["contact"]["ssim"]);
  // With split none ridge regression was fitted to what is tested.
  if (result["split"] != "none" && own < ridge + kHardly)
    warn("the network's contact SSIM, " + format(own, 3) + ", is hardly above that of ridge regression, " +
         format(ridge, 3) + ": more or other recordings, or longer training, would have to help");
  if (const double auroc = number(result["trust"]["auroc"]); auroc < kCoin)
    warn("predicted errors tell less than a coin which pictures are bad (AUROC " + format(auroc, 3) +
         "): do not rely on them here");
  if (const std::size_t count = result["groups"].size(); grouped && count < kFew)
    warn(std::to_string(count) + (count == 1 ? " group was" : " groups were") +
         " tested: others may be drawn much better or worse; --split group --leave-out NAME of "
         "supertac-train tests each in turn");
}

}  // namespace

void print_result(const Arguments& a, const Json& result, bool grouped) {
  a.print("split " + result["split"].get<std::string>() + ", seed " + result["seed"].dump() + ", " +
          result["all"]["windows"].dump() + " windows, " + result["contact"]["windows"].dump() +
          " in contact");
  a.print("            |- in contact -------------| |- all ---------| |- one -|");
  a.print("                 SSIM  PSNR dB   pos mm     SSIM  PSNR dB       us");
  a.print(row("network", result, result["latency"]["network"]));
  for (const auto& [name, scores] : result["baselines"].items())
    a.print(row(name, scores, result["latency"][name]));
  if (const std::string interval = interval_text(result["over_passes"]); !interval.empty())
    a.print("95 % intervals of the network's contact windows over passes: " + interval);
  print_zones(a, result);
  print_groups(a, result["groups"], grouped ? "group" : "plate");
  print_trust(a, result["trust"]);
  if (result.contains("map")) print_map(a, result["map"], a.given("elements"));
  if (result.contains("contact_level"))
    a.print("contact: a pixel of the measured truth above " + figure(result["contact_level"], 3) +
            ", from its noise at rest");
  warn_of(a, result, grouped);
}

}  // namespace supertac
