#include "io/images/images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb/stb_easy_font.h>
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

constexpr int kDot = 2;  // pixels of a dot of a letter
constexpr int kMargin = 10, kBarHeight = 14, kBarWidth = 420;

std::string plain(std::string text) {
  for (char& c : text)
    if (c != '\n' && (c < ' ' || c > '~')) c = '?';
  return text;
}

int lines_of(const std::string& text) { return 1 + static_cast<int>(std::ranges::count(text, '\n')); }

void paste(Picture& onto, const Picture& picture, int left, int top) {
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) onto.set(left + x, top + y, picture.at(x, y));
}

// A rectangle of pixels in a picture.
struct Panel {
  int left, top, width, height;
};

// Pixels are enlarged without smoothing.
void draw_panel(Picture& picture, const Panel& panel, const PanelValues& shown) {
  const auto [values, rows, columns] = shown;
  expect_values("panel_grid", "panel", static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns),
                values.size());
  for (int y = 0; y < panel.height; ++y) {
    const int row = rows - 1 - y * rows / panel.height;
    for (int x = 0; x < panel.width; ++x)
      picture.set(panel.left + x, panel.top + y,
                  colour_of(values[static_cast<std::size_t>(row * columns + x * columns / panel.width)]));
  }
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

Picture::Picture(int w, int h) : width(w), height(h) {
  constexpr int kMax = 65535;
  if (w < 1 || h < 1 || w > kMax || h > kMax)
    throw std::invalid_argument(
        refusal("picture", "sides", "1 to 65535 pixels",
                std::to_string(w) + "x" + std::to_string(h) + "; draw fewer windows or smaller panels"));
  rgb.assign(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 3, 255);
}

Rgb Picture::at(int x, int y) const {
  const std::size_t i = first(x, y);
  return {rgb.at(i), rgb.at(i + 1), rgb.at(i + 2)};
}

void Picture::set(int x, int y, Rgb colour) {
  const std::size_t i = first(x, y);
  for (std::size_t c = 0; c < 3; ++c) rgb.at(i + c) = colour[c];
}

Picture panel_grid(std::span<const PanelValues> panels, int across, int side) {
  if (panels.empty()) throw std::invalid_argument(refusal("panel_grid", "panels", "1 or more", "0"));
  for (const auto& [values, rows, columns] : panels)
    if (std::max(rows, columns) > side)
      throw std::invalid_argument(refusal(
          "panel_grid", "side", std::to_string(std::max(rows, columns)) + " pixels or more, one for a value",
          std::to_string(side)));
  const int longer = std::max(panels.front().rows, panels.front().columns), gap = std::max(1, side / 16),
            width = side * panels.front().columns / longer, height = side * panels.front().rows / longer,
            count = static_cast<int>(panels.size()), down = (count + across - 1) / across;
  Picture picture(across * (width + gap) + gap, down * (height + gap) + gap);
  for (int i = 0; i < count; ++i) {
    const PanelValues& shown = panels[static_cast<std::size_t>(i)];
    const Panel panel{gap + i % across * (width + gap), gap + i / across * (height + gap), width, height};
    if (!shown.values.empty()) draw_panel(picture, panel, shown);
  }
  return picture;
}

void draw_text(Picture& picture, int left, int top, const std::string& text) {
  struct Corner {
    float x, y, z;
    unsigned char colour[4];
  };
  constexpr std::size_t kMostRectangles = 16;  // of a letter
  std::string letters = plain(text);
  std::vector<std::array<Corner, 4>> rectangles(kMostRectangles * (letters.size() + 1));
  const int count = stb_easy_font_print(0, 0, letters.data(), nullptr, rectangles.data(),
                                        static_cast<int>(rectangles.size() * sizeof rectangles[0]));
  rectangles.resize(static_cast<std::size_t>(count));
  for (const auto& corners : rectangles) {
    const auto pixel = [](int from, float dots) { return from + kDot * static_cast<int>(dots); };
    const int right = std::min(pixel(left, corners[2].x), picture.width),
              bottom = std::min(pixel(top, corners[2].y), picture.height);
    for (int y = std::max(0, pixel(top, corners[0].y)); y < bottom; ++y)
      for (int x = std::max(0, pixel(left, corners[0].x)); x < right; ++x) picture.set(x, y, {0, 0, 0});
  }
}

int text_width(const std::string& text) {
  std::string letters = plain(text);
  return kDot * stb_easy_font_width(letters.data());
}

Picture captioned(const Picture& picture, const Captions& c) {
  int left = kMargin, lines = 1;
  for (const auto& row : c.rows) left = std::max(left, 2 * kMargin + text_width(row.text));
  for (const auto& column : c.columns) lines = std::max(lines, lines_of(column.text));
  const int bar = std::max({kBarWidth, text_width(c.low) + text_width(c.high) + 2 * kMargin});
  const int width = std::max({left + picture.width, left + bar, left + text_width(c.title)}) + kMargin;
  const int top = 2 * kMargin + kLineHeight + lines * kLineHeight, below = top + picture.height + kMargin;
  Picture whole(width, below + kBarHeight + 2 * kMargin + kLineHeight);
  paste(whole, picture, left, top);
  draw_text(whole, left, kMargin, c.title);
  for (const auto& column : c.columns)
    draw_text(whole, left + column.at - text_width(column.text) / 2, kMargin + kLineHeight + kMargin / 2,
              column.text);
  for (const auto& row : c.rows)
    draw_text(whole, left - kMargin - text_width(row.text),
              top + row.at - kLineHeight * lines_of(row.text) / 2, row.text);
  std::vector<float> ramp;
  for (int x = 0; x < bar; ++x) ramp.push_back(static_cast<float>(x) / static_cast<float>(bar - 1));
  draw_panel(whole, {left, below, bar, kBarHeight}, {ramp, 1, bar});
  const int words = below + kBarHeight + kMargin / 2;
  draw_text(whole, left, words, c.low);
  draw_text(whole, left + bar - text_width(c.high), words, c.high);
  return whole;
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
