#include "io/images/captions.h"

#include <algorithm>
#include <array>

// The font's functions are static; those that are not called here are no mistake.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wcast-align"
#include <stb/stb_easy_font.h>
#pragma GCC diagnostic pop

namespace supertac {
namespace {

constexpr int kDot = 2;  // pixels of a dot of the font, whose letters are 7 dots high
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

}  // namespace

void draw_text(Picture& picture, int left, int top, const std::string& text, Rgb colour) {
  struct Corner {
    float x, y, z;
    std::array<unsigned char, 4> colour;
  };
  std::string letters = plain(text);
  std::vector<Corner> corners(4 * 64 * (letters.size() + 1));  // no letter has as many strokes
  const int strokes = stb_easy_font_print(0, 0, letters.data(), nullptr, corners.data(),
                                          static_cast<int>(corners.size() * sizeof(Corner)));
  for (int i = 0; i < strokes; ++i) {
    const Corner &first = corners[4 * static_cast<std::size_t>(i)],
                 &last = corners[4 * static_cast<std::size_t>(i) + 2];
    const auto inside = [](float dots, int from, int size) {
      return std::clamp(from + kDot * static_cast<int>(dots), 0, size);
    };
    for (int y = inside(first.y, top, picture.height); y < inside(last.y, top, picture.height); ++y)
      for (int x = inside(first.x, left, picture.width); x < inside(last.x, left, picture.width); ++x)
        picture.set(x, y, colour);
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
  draw_panel(whole, {left, below, bar, kBarHeight}, ramp, 1, bar);
  const int words = below + kBarHeight + kMargin / 2;
  draw_text(whole, left, words, c.low);
  draw_text(whole, left + bar - text_width(c.high), words, c.high);
  return whole;
}

}  // namespace supertac
