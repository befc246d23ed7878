// Words and a colour bar on a picture, so that it can stand in a paper.
#pragma once

#include <string>
#include <vector>

#include "io/images/images.h"

namespace supertac {

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

}  // namespace supertac
