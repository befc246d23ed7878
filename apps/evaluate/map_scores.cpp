#include "apps/evaluate/map_scores.h"

#include <cmath>

#include "data/plates/truth.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {

MapScores::MapScores(const WindowSet& windows, const ModelFile& model, std::vector<Plate> kinds)
    : windows_(windows),
      model_(model),
      stated_(!kinds.empty()),
      kinds_(stated_ ? std::move(kinds) : kinds_of_elements(kAnyKind)),
      by_pass_(windows),
      by_surface_(windows) {}

std::string MapScores::surface_of(std::size_t pass) const {
  const WindowSet::Pass& p = windows_.passes()[pass];
  return p.plate + "_t" + std::to_string(p.trial);
}

void MapScores::add(const Drawn& drawn) {
  const auto [x, y] = windows_.position(drawn.example);
  if (!std::isfinite(x) || !std::isfinite(y) || windows_.zone(drawn.example) == Zone::air) return;
  const std::size_t pass = windows_.pass_of(drawn.example);
  const SurfaceMap fresh(windows_.image(), windows_.frames() > 1);
  of_pass_.try_emplace(pass, fresh).first->second.add(x, y, drawn.pictures[0], drawn.predicted_error);
  of_surface_.try_emplace(surface_of(pass), fresh, pass)
      .first->second.first.add(x, y, drawn.pictures[0], drawn.predicted_error);
  added_.push_back(drawn.example);
}

void MapScores::finish() {
  std::vector<float> read(windows_.image().pixels()), truth(read.size());
  std::map<const SurfaceMap*, Plate> drawn;  // where the kind of the elements is stated
  const auto state = [&](const SurfaceMap& map, std::size_t pass) {
    if (!stated_) return;
    NamedMap one = named("", map, pass);
    drawn.emplace(&map, plate_of(elements(one), recognise(one, kinds_)));
  };
  for (const auto& [pass, map] : of_pass_) state(map, pass);
  for (const auto& [name, map] : of_surface_) state(map.first, map.second);
  for (const std::uint32_t window : added_) {
    const std::size_t pass = windows_.pass_of(window);
    const auto [x, y] = windows_.position(window);
    windows_.truth(window, truth);
    const auto score = [&](const SurfaceMap& map, Scored& scored) {
      stated_ ? truth_image(drawn.at(&map), x, y, windows_.image(), read) : map.read(x, y, read);
      scored.zones.add(read, truth, windows_.zone(window));
      if (const auto one = contact_score(windows_, window, read, truth)) scored.contact.push_back(*one);
    };
    score(of_pass_.at(pass), by_pass_);
    score(of_surface_.at(surface_of(pass)).first, by_surface_);
  }
  for (const NamedMap& map : maps(true))
    if (!map.truth.empty()) (of_surface_.contains(map.name) ? by_surface_ : by_pass_).elements.add(map);
}

std::vector<std::string> MapScores::lines() const {
  if (empty()) return {};
  const auto text = [this](const Scored& scored) {
    const Metrics contact = scored.zones.contact();
    const std::string interval = interval_text(windows_, scored.contact);
    return "SSIM " + format(contact.ssim, 3) + ", PSNR " + format(contact.psnr_mean_db, 2) + " dB" +
           (interval.empty() ? "" : " (95 % over passes: " + interval + ")");
  };
  if (by_pass_.zones.contact().windows == 0) return {};
  const auto found = [](const ElementScores& e) {
    return std::to_string(e.found) + " of " + std::to_string(e.existing) + ", " + std::to_string(e.invented) +
           " false";
  };
  std::vector<std::string> lines = {std::string("in contact, read back from the map of the pass") +
                                    (stated_ ? ", elements drawn as stated: " : ": ") + text(by_pass_) +
                                    "; from that of all passes: " + text(by_surface_)};
  if (by_surface_.elements.existing > 0)
    lines.push_back("elements found within " + format(ElementScores::kFoundMm) +
                    " mm: " + found(by_pass_.elements) + " on maps of passes; " +
                    found(by_surface_.elements) + " on those of all passes");
  return lines;
}

nlohmann::ordered_json MapScores::to_json() const {
  const auto middle = [](std::vector<double> v) { return v.empty() ? NAN : median(v); };  // NaN becomes null
  nlohmann::ordered_json json;
  for (const auto& [name, scored] :
       {std::pair("of_pass", &by_pass_), std::pair("of_surface", &by_surface_)}) {
    const Metrics contact = scored->zones.contact();
    json[name] = {{"ssim", contact.ssim},
                  {"psnr_mean_db", contact.psnr_mean_db},
                  {"felt", scores_by_distance(windows_, scored->contact)},
                  {"over_passes", scores_by_pass(windows_, scored->contact)},
                  {"elements",
                   {{"existing", scored->elements.existing},
                    {"found", scored->elements.found},
                    {"false", scored->elements.invented},
                    {"median_mm", middle(scored->elements.distances_mm)},
                    {"pitch_error_mm", middle(scored->elements.pitch_errors_mm)}}}};
  }
  for (const NamedMap& map : maps(true)) {
    const std::vector<Element> found = elements(map);
    const bool whole = of_surface_.contains(map.name);
    auto& rows = json[whole ? "surfaces" : "passes"][map.name] = {
        {"kind", map.kind}, {"kind_share", map.kind_share}, {"pitch_mm", pitch_mm(found)}};
    if (!whole) continue;
    for (const Element& e : found)
      for (auto& row = rows["elements"].emplace_back(); const auto& [name, value] : numbers_of(e))
        row[name] = value;
  }
  return json;
}

NamedMap MapScores::named(const std::string& name, const SurfaceMap& map, std::size_t pass) const {
  NamedMap named{.name = name, .cells = map.cells(map.felt()), .cell_mm = map.grid().pixel_mm};
  model_.interval().half_widths(named.cells.values, named.cells.region.width, named.cells.errors,
                                named.cells.errors);
  recognise(named, kinds_);
  if (windows_.truth_is_measured(pass)) return named;
  for (std::size_t c = 0; c < named.cells.values.size(); ++c) {
    const auto [x, y] = centre_of(named, c);
    named.truth.push_back(static_cast<float>(truth_value(windows_.plate(pass), x, y)));
  }
  return named;
}

std::vector<NamedMap> MapScores::maps(bool passes) const {
  std::vector<NamedMap> maps;
  for (const auto& [name, map] : of_surface_) maps.push_back(named(name, map.first, map.second));
  if (!passes) return maps;
  for (const auto& [pass, map] : of_pass_)
    maps.push_back(named(surface_of(pass) + "_p" + std::to_string(windows_.passes()[pass].pass), map, pass));
  return maps;
}

}  // namespace supertac
