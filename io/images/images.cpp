#include "io/images/images.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/same_bits.h"

#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>

namespace supertac {
namespace {

constexpr int kMapSize = 256;

std::uint8_t srgb_byte(double linear) {
  const double v = std::clamp(linear, 0.0, 1.0);
  const double encoded = v <= 0.0031308 ? 12.92 * v : 1.055 * same_bits::pow(v, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * encoded));
}

Rgb rgb_of_oklab(double lightness, double a, double b) {
  const double l = lightness + 0.3963377774 * a + 0.2158037573 * b;
  const double m = lightness - 0.1055613458 * a - 0.0638541728 * b;
  const double s = lightness - 0.0894841775 * a - 1.2914855480 * b;
  const double l3 = l * l * l, m3 = m * m * m, s3 = s * s * s;
  return {srgb_byte(4.0767416621 * l3 - 3.3077115913 * m3 + 0.2309699292 * s3),
          srgb_byte(-1.2684380046 * l3 + 2.6097574011 * m3 - 0.3413193965 * s3),
          srgb_byte(-0.0041960863 * l3 - 0.7034186147 * m3 + 1.7076147010 * s3)};
}

// Hue runs from blue (285 degrees) to yellow (105); the chroma stays inside the colours a screen can show.
std::array<Rgb, kMapSize> make_map() {
  std::array<Rgb, kMapSize> map;
  for (int i = 0; i < kMapSize; ++i) {
    const double t = i / (kMapSize - 1.0);
    const double hue = (285 - 180 * t) / 360;
    const double chroma = 0.10 + 0.02 * same_bits::cosine(t);
    map[static_cast<std::size_t>(i)] =
        rgb_of_oklab(0.22 + 0.74 * t, chroma * same_bits::cosine(hue), chroma * same_bits::sine(hue));
  }
  return map;
}

void append(void* context, void* data, int size) {
  auto* out = static_cast<std::vector<std::byte>*>(context);
  const auto* bytes = static_cast<const std::byte*>(data);
  out->insert(out->end(), bytes, bytes + size);
}

int gap_of(int side) { return std::max(1, side / 16); }

// The panel of a strip's part in the picture's corner.
Panel panel_of(const StripLayout& l) {
  const int longer = std::max(l.rows, l.columns);
  return {.width = l.side * l.columns / longer, .height = l.side * l.rows / longer};
}

void check_strips(const char* where, std::span<const Strip> strips, const StripLayout& l) {
  if (strips.empty()) throw std::invalid_argument(std::string(where) + ": there is no window to draw");
  const int size = std::max(l.rows, l.columns) * l.scale;
  if (std::min({l.rows, l.columns, l.scale}) < 1 || l.side < size)
    throw std::invalid_argument(std::string(where) + ": pictures must have 1 to " + std::to_string(l.side) +
                                " pixels a side, the panels' size, got " + std::to_string(size));
}

// Panels of a strip.
int parts_of(std::span<const Strip> strips) {
  return std::ranges::any_of(strips, [](const Strip& s) { return !s.uncertainty.empty(); }) ? 4 : 3;
}

// Strips below each other, their parts side by side; `turned`: the other way round.
Picture picture_of(const char* where, std::span<const Strip> strips, const StripLayout& l, bool turned) {
  check_strips(where, strips, l);
  const int gap = gap_of(l.side), count = static_cast<int>(strips.size()), parts = parts_of(strips);
  Panel panel = panel_of(l);
  const int step_x = panel.width + gap, step_y = panel.height + gap;
  Picture picture((turned ? count : parts) * step_x + gap, (turned ? parts : count) * step_y + gap);
  for (int i = 0; i < count; ++i) {
    const Strip& strip = strips[static_cast<std::size_t>(i)];
    panel.left = gap + (turned ? i * step_x : 0), panel.top = gap + (turned ? 0 : i * step_y);
    draw_panel(picture, panel, strip.input, l.rows, l.columns);
    for (const std::span<const float> part : {strip.output, strip.truth, strip.uncertainty}) {
      if (part.empty()) continue;
      (turned ? panel.top : panel.left) += turned ? step_y : step_x;
      draw_panel(picture, panel, part, l.rows * l.scale, l.columns * l.scale);
    }
  }
  return picture;
}

}  // namespace

Rgb colour_of(float value) {
  static const std::array<Rgb, kMapSize> map = make_map();
  if (std::isnan(value)) return {255, 0, 0};
  return map[level_of(value)];
}

std::uint8_t level_of(float value) {
  if (!(value > 0)) return 0;
  return static_cast<std::uint8_t>(std::lround(std::min(value, 1.0F) * (kMapSize - 1)));
}

Picture::Picture(int w, int h, Rgb background) : width(w), height(h) {
  constexpr int kMax = 65535;
  if (w < 1 || h < 1 || w > kMax || h > kMax)
    throw std::invalid_argument("picture: sides must be 1 to 65535 pixels, got " + std::to_string(w) + " x " +
                                std::to_string(h) + "; draw fewer windows or smaller panels");
  rgb.resize(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 3);
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = background[i % 3];
}

Rgb Picture::at(int x, int y) const {
  const std::size_t i =
      (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * 3;
  return {rgb.at(i), rgb.at(i + 1), rgb.at(i + 2)};
}

void Picture::set(int x, int y, Rgb colour) {
  const std::size_t i =
      (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * 3;
  for (std::size_t c = 0; c < 3; ++c) rgb.at(i + c) = colour[c];
}

void draw_panel(Picture& picture, const Panel& panel, std::span<const float> values, int rows, int cols) {
  if (rows < 1 || cols < 1 ||
      values.size() != static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols))
    throw std::invalid_argument("draw_panel: expects " + std::to_string(rows) + " x " + std::to_string(cols) +
                                " values, got " + std::to_string(values.size()));
  const auto [left, top, width, height] = panel;
  if (width < 1 || height < 1 || left < 0 || top < 0 || left + width > picture.width ||
      top + height > picture.height)
    throw std::invalid_argument("draw_panel: a panel of " + std::to_string(width) + " x " +
                                std::to_string(height) + " pixels at (" + std::to_string(left) + ", " +
                                std::to_string(top) + ") leaves the picture of " +
                                std::to_string(picture.width) + " x " + std::to_string(picture.height));
  for (int y = 0; y < height; ++y) {
    const int row = rows - 1 - y * rows / height;
    for (int x = 0; x < width; ++x)
      picture.set(left + x, top + y,
                  colour_of(values[static_cast<std::size_t>(row * cols + x * cols / width)]));
  }
}

Picture strip_picture(std::span<const Strip> strips, const StripLayout& layout) {
  return picture_of("strip_picture", strips, layout, false);
}

Picture film_picture(std::span<const Strip> strips, const StripLayout& layout) {
  return picture_of("film_picture", strips, layout, true);
}

std::vector<std::byte> encode_png(const Picture& picture) {
  std::vector<std::byte> out;
  const int ok = stbi_write_png_to_func(append, &out, picture.width, picture.height, 3, picture.rgb.data(),
                                        picture.width * 3);
  if (ok == 0) throw std::bad_alloc();  // the encoder has no other way to fail
  return out;
}

void write_png(const std::string& path, const Picture& picture) { write_file(path, encode_png(picture)); }

}  // namespace supertac
