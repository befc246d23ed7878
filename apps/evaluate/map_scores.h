// Maps of the surfaces that were felt, and how good they are.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/evaluate/scoring.h"
#include "data/map/named_map.h"
#include "data/scores/metrics.h"

namespace supertac {

/// Fuses the network's pictures (data/map/surface_map.h), once over each pass and once over all passes of a
/// plate and trial, and reads each picture back from both. Windows in the air and those whose place is not
/// known belong to no map.
class MapScores {
 public:
  /// `model`: whose intervals the maps have; both must outlive this. `kinds`: of the elements, where that is
  /// stated (kinds_of_elements()), else empty: pictures are then read back from what the maps are with
  /// elements of the kind among these that each resembles most.
  MapScores(const WindowSet& windows, const ModelFile& model, std::vector<Plate> kinds);
  /// Windows of a pass come in the order of time.
  void add(const Drawn& drawn);
  /// When all have come: reads them back. Before the rest below.
  void finish();

  bool empty() const { return added_.empty(); }
  /// For people: nothing when empty().
  std::vector<std::string> lines() const;
  /// {"of_pass": {"ssim", "psnr_mean_db", "felt": scores_by_distance(), "over_passes":
  /// scores_by_pass(), "elements": {"existing", "found", "false", "median_mm", "pitch_error_mm"}},
  /// "of_surface": the same, "surfaces": {PLATE_tTRIAL: {"kind", "kind_share", "pitch_mm", "elements":
  /// [{"x_mm", "y_mm", ...}]}}, "passes": {PLATE_tTRIAL_pPASS: the same without "elements"}}
  nlohmann::ordered_json to_json() const;
  /// As the network has them. PLATE_tTRIAL; with passes PLATE_tTRIAL_pPASS behind them.
  std::vector<NamedMap> maps(bool passes) const;

 private:
  struct Scored {
    explicit Scored(const WindowSet& windows) : zones(windows.image()) {}
    ZoneMetrics zones;
    std::vector<ContactScore> contact = {};
    ElementScores elements = {};
  };
  std::string surface_of(std::size_t pass) const;
  NamedMap named(const std::string& name, const SurfaceMap& map, std::size_t pass) const;

  const WindowSet& windows_;
  const ModelFile& model_;
  bool stated_;
  std::vector<Plate> kinds_;  // all that are known, where none is stated
  std::map<std::size_t, SurfaceMap> of_pass_;
  std::map<std::string, std::pair<SurfaceMap, std::size_t>> of_surface_;  // and one of its passes
  std::vector<std::uint32_t> added_;
  Scored by_pass_, by_surface_;
};

}  // namespace supertac
