// How an array's taxels lie, from what they feel: side by side they feel alike.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace supertac {

/// Rows and columns of an array whose frames send taxel k as their order[k]-th; empty: as k.
struct ArrayLayout {
  int rows = 1, columns = 1;
  std::vector<int> order = {};
  std::string text() const;  ///< "6 rows of 10, every second row backwards"
};

struct FoundLayout {
  std::optional<ArrayLayout> layout;  ///< empty where it cannot be told
  std::string says;                   ///< for people, a line
};

/// Of `signals` [place in the frame][frame], while the array was pressed here and there, as how far each is
/// from rest. A layout's score is the sum, over all pairs of taxels side by side, of the correlation in time
/// of what they feel, each frame less its median over the taxels. Layouts are all ways to cut the places into
/// up to 64 rows of up to 64, each row forwards or every second one backwards, the rows in turn, swapped in
/// pairs, or the even ones first. The best is taken where it leads every other by three standard errors of
/// the difference (jackknife over eighths of the time); layouts with the same pairs, such as mirrored,
/// rotated and transposed ones, are one. Taxels that never change are alike to none.
FoundLayout find_layout(std::span<const std::vector<float>> signals);

}  // namespace supertac
