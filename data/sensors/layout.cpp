// How an array's taxels lie, from what they feel: side by side they feel alike.
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "data/sensors/taxel_array.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr int kMostSide = 64;
constexpr std::size_t kParts = 8;

using Pairs = std::set<std::pair<int, int>>;   // of places in the frame
using Parts = std::array<double, kParts + 1>;  // the whole, and without each part

enum class Rows { in_turn, swapped, even_first };

ArrayLayout layout_of(int rows, int columns, bool serpentine, Rows turn) {
  ArrayLayout layout{rows, columns, {}, std::to_string(rows) + " rows of " + std::to_string(columns)};
  if (turn == Rows::swapped) layout.text += ", swapped in pairs";
  if (turn == Rows::even_first) layout.text += ", the even ones first";
  if (serpentine) layout.text += ", every second one sent backwards";
  for (int row = 0; row < rows; ++row) {
    const int half = (rows + 1) / 2;
    const int sent = turn == Rows::swapped      ? std::min(row ^ 1, rows - 1)
                     : turn == Rows::even_first ? (row % 2 == 0 ? row / 2 : half + row / 2)
                                                : row;
    for (int column = 0; column < columns; ++column)
      layout.order.push_back(sent * columns + (serpentine && sent % 2 == 1 ? columns - 1 - column : column));
  }
  return layout;
}

Pairs pairs_of(const ArrayLayout& layout) {
  Pairs pairs;
  const auto add = [&](int k, int other) {
    const int a = layout.order[static_cast<std::size_t>(k)],
              b = layout.order[static_cast<std::size_t>(other)];
    pairs.emplace(std::min(a, b), std::max(a, b));
  };
  for (int k = 0; k < layout.rows * layout.columns; ++k) {
    if (k % layout.columns + 1 < layout.columns) add(k, k + 1);
    if (k + layout.columns < layout.rows * layout.columns) add(k, k + layout.columns);
  }
  return pairs;
}

// What the taxels feel beside what all of them do, [taxel][frame], and its squares.
struct Felt {
  std::vector<std::vector<double>> signals;
  std::vector<Parts> squares;

  static Parts product(const std::vector<double>& a, const std::vector<double>& b) {
    Parts sums{};
    for (std::size_t i = 0; i < a.size(); ++i) sums[1 + i * kParts / a.size()] += a[i] * b[i];
    for (std::size_t p = 1; p <= kParts; ++p) sums[0] += sums[p];
    for (std::size_t p = 1; p <= kParts; ++p) sums[p] = sums[0] - sums[p];
    return sums;
  }
  explicit Felt(std::span<const std::vector<float>> from) {
    const std::size_t frames = from[0].size(), together = frames / 1000 + 1;
    signals.assign(from.size(), std::vector<double>(frames / together + 1));
    std::vector<float> frame(from.size()), rest;
    for (std::vector<float> signal : from) rest.push_back(median(signal));
    for (std::size_t i = 0; i < frames; ++i) {
      for (std::size_t k = 0; k < from.size(); ++k) frame[k] = from[k][i] - rest[k];
      const double common = double{median(std::vector(frame))};
      for (std::size_t k = 0; k < from.size(); ++k) signals[k][i / together] += double{frame[k]} - common;
    }
    for (std::size_t k = 0; k < from.size(); ++k) {
      if (std::ranges::all_of(from[k], [&](float x) { return x == from[k][0]; }))
        std::ranges::fill(signals[k], 0);
      squares.push_back(product(signals[k], signals[k]));
    }
  }
  Parts score(const Pairs& pairs) const {
    Parts sum{};
    for (const auto& [a, b] : pairs) {
      const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
      const Parts both = product(signals[i], signals[j]);
      for (std::size_t p = 0; p <= kParts; ++p)
        if (const double size = squares[i][p] * squares[j][p]; size > 0) sum[p] += both[p] / std::sqrt(size);
    }
    return sum;
  }
};

// Standard errors by which `a` leads `b`.
double lead(const Parts& a, const Parts& b) {
  double mean = 0, squares = 0;
  for (std::size_t p = 1; p <= kParts; ++p) mean += (a[p] - b[p]) / kParts;
  for (std::size_t p = 1; p <= kParts; ++p) squares += std::pow(a[p] - b[p] - mean, 2);
  return (a[0] - b[0]) / std::sqrt(std::max(squares * (kParts - 1) / kParts, 1e-12));
}

}  // namespace

FoundLayout find_layout(std::span<const std::vector<float>> signals) {
  const int taxels = static_cast<int>(signals.size());
  if (taxels < 2 || signals[0].size() < 2 * kParts) return {{}, "too few frames to tell the layout from"};
  struct Candidate {
    ArrayLayout layout;
    Parts score;
  };
  const Felt felt(signals);
  std::vector<Candidate> candidates;
  std::set<Pairs> seen;
  for (int rows = 1; rows <= std::min(taxels, kMostSide); ++rows)
    for (const bool serpentine : {false, true})
      for (const Rows turn : {Rows::in_turn, Rows::swapped, Rows::even_first}) {
        if (taxels % rows != 0 || taxels / rows > kMostSide) continue;
        const ArrayLayout layout = layout_of(rows, taxels / rows, serpentine, turn);
        if (const auto [pairs, is_new] = seen.insert(pairs_of(layout)); is_new)
          candidates.push_back({layout, felt.score(*pairs)});
      }
  if (candidates.empty()) return {{}, "no array of up to 64 x 64 taxels has so many"};
  std::ranges::stable_sort(candidates, std::greater(), [](const Candidate& c) { return c.score[0]; });
  Candidate& best = candidates[0];
  const Candidate* next = nullptr;  // that is the hardest to tell from the best
  double least = lead(best.score, {});
  for (std::size_t c = 1; c < candidates.size(); ++c)
    if (const double errors = lead(best.score, candidates[c].score); errors < least)
      least = errors, next = &candidates[c];
  if (!(least > 3))
    return {{},
            "neighbours do not tell the layout" +
                (next == nullptr || !(lead(best.score, {}) > 3)
                     ? ""
                     : ": " + best.layout.text + ", or " + next->layout.text) +
                "; press all of the array, here and there, for longer"};
  std::string says = "taxels side by side feel alike: " + best.layout.text;
  if (next != nullptr) says += " (" + format(least, 1) + " standard errors before " + next->layout.text + ")";
  std::vector<int> plain = best.layout.order;
  std::ranges::sort(plain);
  if (plain == best.layout.order) best.layout.order.clear();
  return {best.layout, says + "; whether it is mirrored or turned can never be told so"};
}

}  // namespace supertac
