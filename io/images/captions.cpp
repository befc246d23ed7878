#include "io/images/captions.h"

#include <algorithm>
#include <cstdint>

namespace supertac {
namespace {

constexpr int kDot = 2;                  // pixels of a dot of a letter
constexpr int kDotsWide = 5, kStep = 6;  // dots of a letter, and to the next
// The letters of a character display, ' ' to '~', 5x7 dots: a byte for each column from the left, the least
// significant first, and a bit for each dot from the top.
constexpr std::uint64_t kLetters[] = {
    // clang-format off
    0x0000000000, 0x00005F0000, 0x0007000700, 0x147F147F14, 0x122A7F2A24, 0x6264081323, 0x5022554936,
    0x0000030500, 0x0041221C00, 0x001C224100, 0x14083E0814, 0x08083E0808, 0x0000305000, 0x0808080808,
    0x0000606000, 0x0204081020, 0x3E4549513E, 0x00407F4200, 0x4649516142, 0x314B454121, 0x107F121418,
    0x3945454527, 0x3049494A3C, 0x0305097101, 0x3649494936, 0x1E29494906, 0x0000363600, 0x0000365600,
    0x0041221408, 0x1414141414, 0x0814224100, 0x0609510102, 0x3E41794932, 0x7E1111117E, 0x364949497F,
    0x224141413E, 0x1C2241417F, 0x414949497F, 0x010909097F, 0x7A4949413E, 0x7F0808087F, 0x00417F4100,
    0x013F414020, 0x412214087F, 0x404040407F, 0x7F020C027F, 0x7F1008047F, 0x3E4141413E, 0x060909097F,
    0x5E2151413E, 0x462919097F, 0x3149494946, 0x01017F0101, 0x3F4040403F, 0x1F2040201F, 0x3F4038403F,
    0x6314081463, 0x0708700807, 0x4345495161, 0x0041417F00, 0x2010080402, 0x007F414100, 0x0402010204,
    0x4040404040, 0x0004020100, 0x7854545420, 0x384444487F, 0x2044444438, 0x7F48444438, 0x1854545438,
    0x0201097E08, 0x3E5252520C, 0x780404087F, 0x00407D4400, 0x003D444020, 0x004428107F, 0x00407F4100,
    0x780418047C, 0x780404087C, 0x3844444438, 0x081414147C, 0x7C18141408, 0x080404087C, 0x2054545448,
    0x2040443F04, 0x7C2040403C, 0x1C2040201C, 0x3C4030403C, 0x4428102844, 0x3C5050500C, 0x444C546444,
    0x0041360800, 0x00007F0000, 0x0008364100, 0x0810080810,
    // clang-format on
};
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
  int x = left;
  for (const char c : plain(text)) {
    if (c == '\n') {
      x = left, top += kLineHeight;
      continue;
    }
    for (int dot = 0; dot < kDotsWide * 8; ++dot) {
      if ((kLetters[c - ' '] >> dot & 1) == 0) continue;
      for (int i = 0; i < kDot * kDot; ++i) {
        const int px = x + kDot * (dot / 8) + i % kDot, py = top + kDot * (dot % 8) + i / kDot;
        if (px >= 0 && py >= 0 && px < picture.width && py < picture.height) picture.set(px, py, {0, 0, 0});
      }
    }
    x += kDot * kStep;
  }
}

int text_width(const std::string& text) {
  int widest = 0, letters = 0;
  for (const char c : text) {
    letters = c == '\n' ? 0 : letters + 1;
    widest = std::max(widest, letters);
  }
  return kDot * kStep * widest;
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
