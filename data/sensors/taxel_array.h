// What an array of taxels is, and how a picture of it divides into pixels.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/rig.h"

namespace supertac {

/// A distance along a row (x) and from row to row (y). Converts from one number that is both.
struct Pitch {
  double x, y;
  Pitch(double both) : x(both), y(both) {}
  Pitch(double along_a_row, double from_row_to_row) : x(along_a_row), y(from_row_to_row) {}

  Pitch operator/(double parts) const { return {x / parts, y / parts}; }
  /// "3", or "2 x 4" (x first)
  std::string text() const;
  bool operator==(const Pitch&) const = default;
};

/// A picture of the surface under the array: pixels, and how large they are.
struct ImageGrid {
  int height = 16, width = 16;
  Pitch pixel_mm = 0.75;

  std::size_t pixels() const { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }
  double height_mm() const { return height * pixel_mm.y; }
  double width_mm() const { return width * pixel_mm.x; }
  /// "16x16"
  std::string text() const;
  bool operator==(const ImageGrid&) const = default;
};

/// What a sensor is: rows x columns taxels, pitch_mm apart, each of which gives `channels` numbers
/// a frame (one voltage; three axes of a magnetic field). Number s of a frame is channel s % channels of
/// taxel s / channels; taxel k lies in row k / columns (y) and column k % columns (x).
struct TaxelArray {
  int rows = rig::kTaxelRows, columns = rig::kTaxelColumns;
  Pitch pitch_mm = rig::kTaxelPitchMm;
  int channels = 1;

  int taxels() const { return rows * columns; }
  /// Place of taxel k from the array's centre.
  double x_mm(int k) const { return (k % columns - (columns - 1) / 2.0) * pitch_mm.x; }
  double y_mm(int k) const {
    const int row = k / columns;
    return (row - (rows - 1) / 2.0) * pitch_mm.y;
  }
  /// Numbers in a frame.
  std::size_t signals() const {
    return static_cast<std::size_t>(taxels()) * static_cast<std::size_t>(channels);
  }
  /// The rectangle around each taxel, cut into scale x scale pixels.
  ImageGrid picture(int scale) const { return {rows * scale, columns * scale, pitch_mm / scale}; }
  /// "4x4 taxels at 3 mm", "2x6 taxels at 2.5 mm with 3 channels"
  std::string text() const;
  /// Throws std::invalid_argument outside 1 to 64 rows and columns, 1 to 8 channels, and a pitch of 0.1 to
  /// 100 mm.
  void check() const;
  bool operator==(const TaxelArray&) const = default;
};

/// The mean over each taxel's channels, [rows][columns]: a frame as a picture shows it.
/// Throws std::invalid_argument unless the frame has array.signals() values.
std::vector<float> mean_of_channels(const TaxelArray& array, std::span<const float> frame);

/// Rows and columns of an array whose frames send taxel k as their order[k]-th; empty: as k.
struct ArrayLayout {
  int rows = 1, columns = 1;
  std::vector<int> order = {};
  std::string text = {};  ///< "6 rows of 10, every second one sent backwards"
};
struct FoundLayout {
  std::optional<ArrayLayout> layout;  ///< empty where it cannot be told
  std::string says;                   ///< for people, a line
};

/// How an array's taxels lie, from `signals` [place in the frame][frame], while it was pressed here and
/// there. A layout's score is the sum, over all pairs of taxels side by side, of the correlation in time of
/// what they feel: how far each is from its median, less the median of that over the taxels. Layouts are all
/// ways to cut the places into up to 64 rows of up to 64, each row forwards or every second one backwards,
/// the rows in turn, swapped in pairs, or the even ones first. The best is taken where it leads every other
/// by three standard errors of the difference (jackknife over eighths of the time); layouts with the same
/// pairs, such as mirrored, rotated and transposed ones, are one. Taxels that never change are alike to none.
FoundLayout find_layout(std::span<const std::vector<float>> signals);

}  // namespace supertac
