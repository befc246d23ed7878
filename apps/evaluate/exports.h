// What an evaluation shows: lines, pictures, the arrays behind them, and a page.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/output/output_folder.h"
#include "apps/evaluate/scoring.h"
#include "data/windows/windows.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/inference/interval.h"

namespace supertac {

/// Collects windows [N,T,signals] as the network takes them, outputs [N,H,W], truths [N,H,W] and, where the
/// network has one, predicted errors [N,H,W], and writes them as one safetensors file with tensors "input",
/// "output", "truth" and "predicted_error"; beside them "position_mm" F64 [N,2], the finger's centre (NaN:
/// unknown), and "pass" I64 [N], windows of one pass having the same number.
class OutputsFile {
 public:
  explicit OutputsFile(const WindowSet& windows) : windows_(windows) {}
  void add(const Drawn& drawn);
  /// Throws FileError.
  void write(const OutputPath& output) const;

 private:
  const WindowSet& windows_;
  std::vector<float> input_, output_, truth_, predicted_error_;
  std::vector<double> position_mm_;
  std::vector<std::int64_t> pass_;
};

/// strips.png: windows in contact spread over the test windows, input | output | truth and, where
/// the network says it, half the width of a pixel's 90 % interval; and for each test pass
/// film_<plate>_t<trial>_p<pass>.png. Throws FileError.
void write_pictures(const Ensemble& model, const PixelInterval& interval, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder);

/// The page of an evaluation: scores beside those of the baselines, by group or plate (the worst first), zone
/// and distance since the first contact; the three worst windows in contact of each of the eight worst
/// groups; the twelve worst windows in contact, and the twelve best of those with texture on a quarter of the
/// picture, no two of them within 3 mm of one pass (20 windows where the truth was measured); and what made
/// it all. `result` is the evaluation's JSON; `made_by` says what to repeat it with, a name and a text each.
/// The windows shown are drawn once more.
std::string evaluation_page(const Ensemble& network, const WindowSet& windows,
                            std::span<const ContactScore> scores, const nlohmann::ordered_json& result,
                            const std::vector<std::pair<std::string, std::string>>& made_by);

/// The table of an evaluation's JSON, a line for whatever else it says, and warnings: that the network is
/// hardly above ridge regression, that its predicted errors do not tell bad pictures, that few groups were
/// tested. `grouped`: has_groups().
void print_result(const Arguments& a, const nlohmann::ordered_json& result, bool grouped);

}  // namespace supertac
