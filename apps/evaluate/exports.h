// What an evaluation shows besides its table: pictures, and the arrays behind them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "apps/common/output/output_folder.h"
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
  OutputsFile(const TaxelArray& array, std::size_t timesteps, const ImageGrid& image);
  void add(std::span<const float> window, std::span<const float> output, std::span<const float> truth,
           std::span<const float> predicted_error, const WindowSet::Position& position, std::size_t pass);
  /// Throws FileError.
  void write(const OutputPath& output) const;

 private:
  std::uint64_t timesteps_, signals_, height_, width_, count_ = 0;
  std::vector<float> input_, output_, truth_, predicted_error_;
  std::vector<double> position_mm_;
  std::vector<std::int64_t> pass_;
};

/// strips.png: windows in contact spread over the test windows, input | output | truth and, where
/// the network says it, half the width of a pixel's 90 % interval; and for each test pass
/// film_<plate>_t<trial>_p<pass>.png. Throws FileError.
void write_pictures(const Ensemble& model, const PixelInterval& interval, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder);

}  // namespace supertac
