#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace supertac {

using Rgb = std::array<std::uint8_t, 3>;

/// Perceptual colour map for values 0..1 (others are clipped; not a number is red): dark blue over teal and
/// green to pale yellow. A path in Oklab (Ottosson 2020) whose lightness grows evenly from .22 to .96, so
/// that equal steps of height look equally large and a grey print keeps their order.
Rgb colour_of(float value);
/// The step of the map's 256 that a value has: round(255 value), clipped; 0 for not a number.
std::uint8_t level_of(float value);

/// 8-bit RGB pixels, rows from the top, [height][width][3].
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;

  /// A picture of one colour. Throws std::invalid_argument unless both sides are 1..65535.
  Picture(int width, int height, Rgb background = {255, 255, 255});
  /// (x, y) must lie in the picture; past its last pixel both throw std::out_of_range.
  Rgb at(int x, int y) const;
  void set(int x, int y, Rgb colour);
};

/// A rectangle of pixels in a picture.
struct Panel {
  int left = 0, top = 0, width = 0, height = 0;
};

/// Draws values [rows][cols] into a panel, y upwards: row 0, the smallest y, is at the bottom. Pixels are
/// enlarged without smoothing.
/// Throws std::invalid_argument when values is not rows * cols or the panel leaves the picture.
void draw_panel(Picture& picture, const Panel& panel, std::span<const float> values, int rows, int cols);

/// What one window looks like. Rows grow with y, columns with x.
struct Strip {
  std::span<const float> input;   ///< [rows][columns], the window's last frame (mean of a taxel's channels)
  std::span<const float> output;  ///< [rows * scale][columns * scale]
  std::span<const float> truth;   ///< [rows * scale][columns * scale]
  std::span<const float> uncertainty;  ///< the same, how far off the output may be; empty = not drawn
};

/// How strips are drawn: each part in a panel whose longer side has `side` pixels.
struct StripLayout {
  int rows = 4, columns = 4, scale = 4, side = 128;
};

/// One line per strip: input | output | truth | uncertainty, if any has one, with gaps of side / 16 (at least
/// 1). Throws std::invalid_argument when there is no strip or a size is wrong.
Picture strip_picture(std::span<const Strip> strips, const StripLayout& layout);

/// A whole pass as a film: one column per strip, in the order given; input above output above
/// truth above uncertainty.
/// Throws as strip_picture.
Picture film_picture(std::span<const Strip> strips, const StripLayout& layout);

/// The picture as a PNG file's bytes.
std::vector<std::byte> encode_png(const Picture& picture);

/// Writes a PNG atomically. Throws FileError naming the path.
void write_png(const std::string& path, const Picture& picture);

}  // namespace supertac
