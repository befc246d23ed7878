#include "data/sensors/taxel_array.h"

#include "tests/support/draws.h"

namespace supertac::layout_test {

// Taxels side by side, as places in the frame: the same for what is mirrored or turned.
std::set<std::pair<int, int>> pairs_of(int rows, int columns, const std::function<int(int, int)>& place) {
  std::set<std::pair<int, int>> pairs;
  const auto add = [&](int a, int b) { pairs.emplace(std::min(a, b), std::max(a, b)); };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      if (c + 1 < columns) add(place(r, c), place(r, c + 1));
      if (r + 1 < rows) add(place(r, c), place(r + 1, c));
    }
  return pairs;
}

enum class Sent { in_turn, serpentine, swapped, mirrored, even_first };

struct Pressing {
  int rows, columns;
  std::uint64_t seed;
  Sent form = Sent::in_turn;
  double seconds = 20, reach = 1.1, noise = 0.02;  // reach: of a press, in pitches

  int place(int row, int column) const {  // in the frame
    int sent = form == Sent::swapped ? std::min(row ^ 1, rows - 1) : row;
    if (form == Sent::even_first) sent = row % 2 == 0 ? row / 2 : (rows + 1) / 2 + row / 2;
    const bool back = form == Sent::mirrored || (form == Sent::serpentine && sent % 2 == 1);
    return sent * columns + (back ? columns - 1 - column : column);
  }
  // A finger comes down somewhere, moves a little and leaves; one taxel in 20 is dead, and all drift.
  std::vector<std::vector<float>> signals() const {
    Draws draw(seed, 3);
    std::vector<std::vector<float>> sent(static_cast<std::size_t>(rows * columns));
    double y = 0, x = 0, force = 0;
    for (int n = 0; n < seconds * 50; ++n) {
      const double phase = n % 40 / 40.0;
      if (n % 40 == 0) y = draw() * rows - 0.5, x = draw() * columns - 0.5, force = 0.3 + draw();
      x += 0.05 * draw.normal(), y += 0.05 * draw.normal();
      for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
          const double far = (std::pow(row - y, 2) + std::pow(column - x, 2)) / (2 * reach * reach);
          const bool dead =
              draw.random.uniform(1'000'000 + static_cast<std::uint64_t>(place(row, column))) < 0.05;
          const double press = phase < 0.6 ? force * std::exp(-far) : 0;
          sent[static_cast<std::size_t>(place(row, column))].push_back(
              static_cast<float>(dead ? 0 : press + noise * draw.normal() + 0.1 * std::sin(n / 300.0)));
        }
    }
    return sent;
  }
  bool is(const ArrayLayout& layout) const {
    const auto at = [&](int row, int column) {
      const int k = row * layout.columns + column;
      return layout.order.empty() ? k : layout.order[static_cast<std::size_t>(k)];
    };
    return pairs_of(layout.rows, layout.columns, at) ==
           pairs_of(rows, columns, [this](int row, int column) { return place(row, column); });
  }
};

TEST(Layout, IsFoundFromWhatNeighboursFeelOrNotTold) {
  int right = 0, all = 0;
  std::uint64_t seed = 100;
  for (const auto& [rows, columns] : {std::pair(10, 6), {6, 10}, {16, 16}, {4, 4}, {8, 3}})
    for (const int form : {0, 1, 2, 3, 4})
      for (const double reach : {0.7, 1.1, 1.8}) {
        const Pressing pressing{rows, columns, ++seed, static_cast<Sent>(form), 20, reach};
        const FoundLayout found = find_layout(pressing.signals());
        ++all, right += found.layout ? 1 : 0;
        EXPECT_TRUE(!found.layout || pressing.is(*found.layout))
            << rows << "x" << columns << " form " << form << " reach " << reach << ": " << found.says;
      }
  RecordProperty("right", right);
  EXPECT_GE(right, 0.85 * all);
}

TEST(Layout, OfLittleIsNotTold) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Pressing rest{6, 10, seed, Sent::in_turn, 10, 0.01};
    EXPECT_FALSE(find_layout(rest.signals()).layout) << "no press reaches a neighbour";
    const Pressing one{6, 10, seed, Sent::serpentine, 0.7};
    const FoundLayout found = find_layout(one.signals());
    EXPECT_TRUE(!found.layout || one.is(*found.layout)) << "after one press: " << found.says;
  }
  EXPECT_EQ(find_layout(std::vector<std::vector<float>>(4)).says, "too few frames to tell the layout from");
}

TEST(Layout, SaysHowFramesAreSent) {
  const FoundLayout found = find_layout(Pressing{4, 7, 5, Sent::serpentine}.signals());
  ASSERT_TRUE(found.layout) << found.says;
  EXPECT_EQ(found.layout->text, "4 rows of 7, every second one sent backwards") << found.says;
  EXPECT_EQ(std::vector(found.layout->order.begin() + 7, found.layout->order.begin() + 14),
            (std::vector{13, 12, 11, 10, 9, 8, 7}));
  EXPECT_NE(found.says.find("whether it is mirrored or turned can never be told so"), std::string::npos);
}

}  // namespace supertac::layout_test
