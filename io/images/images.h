// Pictures for people: values as colours in panels, with words and a colour bar around them, as PNG.
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
/// green to pale yellow. A path in Oklab (Ottosson 2020) whose lightness grows evenly from 0.22 to 0.96, so
/// that equal steps of height look equally large and a grey print keeps their order.
Rgb colour_of(float value);
/// The step of the map's 256 that a value has: round(255 value), clipped; 0 for not a number.
std::uint8_t level_of(float value);

/// 8-bit RGB pixels, rows from the top, [height][width][3].
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;

  /// A white picture. Throws std::invalid_argument unless both sides are 1..65535.
  Picture(int width, int height);
  /// (x, y) must lie in the picture; past its last pixel both throw std::out_of_range.
  Rgb at(int x, int y) const;
  void set(int x, int y, Rgb colour);

 private:
  std::size_t first(int x, int y) const {
    return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  }
};

/// What a panel of a grid shows: values [rows][columns], y upwards: row 0, the smallest y, is at the bottom.
/// It stays empty without any.
struct PanelValues {
  std::span<const float> values;
  int rows, columns;
};

/// Panels of one size, row by row from the top, `across` in a row, with gaps of side / 16 pixels (at least
/// 1). They have the shape of the first one's values; the longer side has `side` pixels. Throws
/// std::invalid_argument when there is no panel, or one has more values a side than pixels or not rows *
/// columns.
Picture panel_grid(std::span<const PanelValues> panels, int across, int side);

inline constexpr int kLineHeight = 24;

/// Writes lines (separated by '\n') in letters of stb_easy_font from (left, top) on; letters outside ASCII
/// become '?', and what lies outside the picture is cut.
void draw_text(Picture& picture, int left, int top, const std::string& text);
/// Width of the longest line in pixels.
int text_width(const std::string& text);

struct Captions {
  struct Heading {
    int at = 0;  ///< pixel of the picture that it stands at
    std::string text = {};
  };
  std::string title = {};
  std::vector<Heading> columns = {},
                       rows = {};   ///< centred above, and right of the margin beside the picture
  std::string low = {}, high = {};  ///< what the ends of the colour bar mean
};

/// The picture with title, headings and colour bar around it.
Picture captioned(const Picture& picture, const Captions& captions);

/// The picture as a PNG file's bytes.
std::vector<std::byte> encode_png(const Picture& picture);

/// Writes a PNG atomically. Throws FileError naming the path.
void write_png(const std::string& path, const Picture& picture);

}  // namespace supertac
