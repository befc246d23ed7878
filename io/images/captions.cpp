#include "io/images/captions.h"

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <array>

namespace supertac {
namespace {

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

}  // namespace

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
  draw_panel(whole, {left, below, bar, kBarHeight}, ramp, 1, bar);
  const int words = below + kBarHeight + kMargin / 2;
  draw_text(whole, left, words, c.low);
  draw_text(whole, left + bar - text_width(c.high), words, c.high);
  return whole;
}

}  // namespace supertac
