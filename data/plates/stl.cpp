#include "data/plates/stl.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

static_assert(std::endian::native == std::endian::little, "STL files are little-endian");

constexpr std::size_t kTitleBytes = 80, kHeadBytes = 84, kFacetBytes = 50;

bool usable(double coordinate) { return std::abs(coordinate) <= double{kMaxStlCoordinateMm}; }  // no NaN

std::vector<Triangle> parse_binary(std::span<const std::byte> bytes, const std::string& name) {
  std::vector<Triangle> triangles((bytes.size() - kHeadBytes) / kFacetBytes);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const std::byte* facet = bytes.data() + kHeadBytes + i * kFacetBytes;
    std::memcpy(&triangles[i], facet + 3 * sizeof(float), sizeof(Triangle));  // behind the normal
    for (const auto& corner : triangles[i]) {
      for (const float coordinate : corner) {
        if (usable(coordinate)) continue;
        throw FileError(name, "triangle " + std::to_string(i + 1) + " has the coordinate " +
                                  format(coordinate) +
                                  ", expected a number within +-1000000 mm; export the model again");
      }
    }
  }
  return triangles;
}

// Words of the text form, with the number of their line.
class Words {
 public:
  Words(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  /// The next word; empty at the end.
  std::string_view next() {
    const std::size_t begin = std::min(text_.find_first_not_of(kSpace, at_), text_.size());
    at_ = std::min(text_.find_first_of(kSpace, begin), text_.size());
    return text_.substr(begin, at_ - begin);
  }
  void skip_line() { at_ = std::min(text_.find_first_of("\r\n", at_), text_.size()); }
  void expect(std::string_view word) {
    if (const auto found = next(); !same(found, word)) reject(std::string(word), found);
  }
  float coordinate() {
    const auto word = next();
    const auto number = parse_double(word.starts_with('+') ? word.substr(1) : word);
    if (!number || !usable(*number)) reject("a number within +-1000000 mm", word);
    return static_cast<float>(*number);
  }
  static bool same(std::string_view found, std::string_view word) {
    return std::ranges::equal(found, word, {}, lower);
  }
  [[noreturn]] void reject(const std::string& expected, std::string_view found) const {
    const auto line = 1 + std::ranges::count(text_.substr(0, at_), '\n');
    throw FileError(name_, "line " + std::to_string(line) + ": expected " + expected + ", found " +
                               (found.empty() ? "the end of the file" : in_quotes(found)) +
                               "; the file is damaged or no STL, export it again");
  }

 private:
  static constexpr std::string_view kSpace = " \t\n\v\f\r";
  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
};

// Behind the word "facet".
Triangle parse_facet(Words& words) {
  words.expect("normal");
  for (int i = 0; i < 3; ++i) words.next();  // some writers put nan here; nothing uses it
  words.expect("outer");
  words.expect("loop");
  Triangle triangle{};
  for (auto& corner : triangle) {
    words.expect("vertex");
    for (float& coordinate : corner) coordinate = words.coordinate();
  }
  words.expect("endloop");
  words.expect("endfacet");
  return triangle;
}

std::vector<Triangle> parse_text(std::string_view text, const std::string& name) {
  std::vector<Triangle> triangles;
  Words words(text, name);
  for (auto word = words.next(); !word.empty(); word = words.next()) {
    if (!Words::same(word, "solid")) words.reject("solid", word);
    words.skip_line();  // the solid's name
    for (word = words.next(); Words::same(word, "facet"); word = words.next())
      triangles.push_back(parse_facet(words));
    if (!Words::same(word, "endsolid")) words.reject("facet or endsolid", word);
    words.skip_line();
  }
  return triangles;
}

}  // namespace

std::vector<Triangle> parse_stl(std::span<const std::byte> bytes, const std::string& name) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // byte-order mark
  std::uint32_t count = 0;
  if (bytes.size() >= kHeadBytes) std::memcpy(&count, bytes.data() + kTitleBytes, sizeof count);
  const std::uint64_t length = kHeadBytes + std::uint64_t{kFacetBytes} * count;
  std::vector<Triangle> triangles;
  if (bytes.size() >= kHeadBytes && length == bytes.size()) {
    triangles = parse_binary(bytes, name);
  } else if (Words::same(Words(text, name).next().substr(0, 5), "solid") &&
             text.find('\0') == std::string_view::npos) {
    triangles = parse_text(text, name);
  } else if (bytes.size() < kHeadBytes) {
    throw FileError(name, "has " + std::to_string(bytes.size()) +
                              " bytes, expected an STL file of 84 or more; export it again");
  } else {
    throw FileError(name, "announces " + std::to_string(count) + " triangles, expected " +
                              std::to_string(length) + " bytes, found " + std::to_string(bytes.size()) +
                              "; the file was cut off or is no STL");
  }
  if (triangles.empty()) throw FileError(name, "holds no triangle; export the model again");
  return triangles;
}

std::vector<Triangle> read_stl(const std::string& path) {
  return parse_stl(read_file(path, kMaxStlBytes), path);
}

std::vector<std::byte> stl_bytes(const std::vector<Triangle>& triangles, std::string_view title) {
  constexpr std::size_t kMost = (kMaxStlBytes - kHeadBytes) / kFacetBytes;
  if (triangles.size() > kMost)
    throw std::invalid_argument(refusal("stl_bytes", "triangles", "at most " + std::to_string(kMost),
                                        std::to_string(triangles.size()) + "; try a coarser resolution"));
  std::vector<std::byte> bytes(kHeadBytes + kFacetBytes * triangles.size());
  std::memcpy(bytes.data(), title.data(), std::min(title.size(), kTitleBytes));
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::memcpy(bytes.data() + kTitleBytes, &count, sizeof count);
  std::byte* facet = bytes.data() + kHeadBytes;
  for (const Triangle& triangle : triangles) {
    std::memcpy(facet + 3 * sizeof(float), &triangle, sizeof triangle);
    facet += kFacetBytes;
  }
  return bytes;
}

namespace {

constexpr float kNothing = -std::numeric_limits<float>::infinity();
constexpr double kExtentSlackMm = 0.1, kFlatMm = 1e-3, kUniformMm = 0.05;
constexpr double kEdge = 1e-6;  // cells: a node on an edge belongs to both triangles, after rounding too
constexpr std::size_t kMaxSteps = 32'000'000;  // rows and nodes: 120 layers of the whole plate

struct Corner {
  double u, v, z;  // in cells, in mm
};

// Moves and stretches (by less than kExtentSlackMm) the model so that it begins at 0 and fills the grid.
struct Fit {
  double low[2], scale[2];
  Corner operator()(const std::array<float, 3>& p) const {
    return {(double{p[0]} - low[0]) * scale[0], (double{p[1]} - low[1]) * scale[1], p[2]};
  }
};

Fit fit_to(const std::vector<Triangle>& triangles, const std::string& name) {
  const double width = rig::kPlateWidthMm, length = rig::kPlateLengthMm;
  float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (const Triangle& triangle : triangles)
    for (const auto& corner : triangle)
      for (std::size_t k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], corner[k]);
        high[k] = std::max(high[k], corner[k]);
      }
  const double extent[2] = {double{high[0]} - double{low[0]}, double{high[1]} - double{low[1]}};
  if (!(std::abs(extent[0] - width) <= kExtentSlackMm) || !(std::abs(extent[1] - length) <= kExtentSlackMm)) {
    throw FileError(name, "measures " + format(extent[0], 2) + " x " + format(extent[1], 2) +
                              " mm in x and y, expected " + format(width, 0) + " x " + format(length, 0) +
                              "; scale or turn the model (STL has no units, mm are assumed)");
  }
  return {{low[0], low[1]},
          {width / HeightMap::kCellMm / extent[0], length / HeightMap::kCellMm / extent[1]}};
}

// Where the line v = row cuts the triangle: its leftmost and rightmost point.
struct Cut {
  Corner left{INFINITY, 0, 0}, right{-INFINITY, 0, 0};
  void add(double u, double z) {
    if (u < left.u || (u == left.u && z > left.z)) left = {u, 0, z};
    if (u > right.u || (u == right.u && z > right.z)) right = {u, 0, z};
  }
};

Cut cut_at(const Corner (&corners)[3], double row) {
  Cut cut;
  for (int i = 0; i < 3; ++i) {
    const Corner &a = corners[i], &b = corners[(i + 1) % 3];
    if (row < std::min(a.v, b.v) - kEdge || row > std::max(a.v, b.v) + kEdge) continue;
    if (std::abs(b.v - a.v) < kEdge) {
      cut.add(a.u, a.z);
      cut.add(b.u, b.z);
    } else {
      const double t = std::clamp((row - a.v) / (b.v - a.v), 0.0, 1.0);
      cut.add(a.u + t * (b.u - a.u), a.z + t * (b.z - a.z));
    }
  }
  return cut;
}

// Raises the nodes of the grid to the triangle. Returns rows and nodes looked at
std::size_t raise(const Corner (&corners)[3], std::vector<float>& z) {
  const auto first_node = [](double at) {
    return static_cast<std::ptrdiff_t>(std::max(0.0, std::ceil(at - kEdge)));
  };
  const auto last_node = [](double at, std::size_t count) {
    return static_cast<std::ptrdiff_t>(std::min(static_cast<double>(count) - 1, std::floor(at + kEdge)));
  };
  const auto [low, high] = std::minmax({corners[0].v, corners[1].v, corners[2].v});
  std::size_t steps = 1;
  for (std::ptrdiff_t row = first_node(low); row <= last_node(high, HeightMap::kRows); ++row) {
    ++steps;
    const Cut cut = cut_at(corners, static_cast<double>(row));
    if (cut.left.u > cut.right.u) continue;
    const double width = cut.right.u - cut.left.u;
    const double top = std::max(cut.left.z, cut.right.z);
    for (std::ptrdiff_t column = first_node(cut.left.u);
         column <= last_node(cut.right.u, HeightMap::kColumns); ++column) {
      ++steps;
      const double part =
          width > kEdge ? std::clamp((static_cast<double>(column) - cut.left.u) / width, 0.0, 1.0) : 0;
      const double height = width > kEdge ? cut.left.z + part * (cut.right.z - cut.left.z) : top;
      float& node = z[static_cast<std::size_t>(row) * HeightMap::kColumns + static_cast<std::size_t>(column)];
      node = std::max(node, static_cast<float>(height));
    }
  }
  return steps;
}

}  // namespace

HeightMap::HeightMap(const std::vector<Triangle>& triangles, const std::string& name)
    : z_(kColumns * kRows, kNothing) {
  const Fit fit = fit_to(triangles, name);
  std::size_t steps = 0;
  for (const Triangle& triangle : triangles) {
    const Corner corners[3] = {fit(triangle[0]), fit(triangle[1]), fit(triangle[2])};
    steps += raise(corners, z_);
    if (steps > kMaxSteps) {
      throw FileError(name, "its triangles cover the plate more than " +
                                std::to_string(kMaxSteps / z_.size()) +
                                " times; simplify the model to its surface");
    }
  }
  const auto holes = std::count(z_.begin(), z_.end(), kNothing);
  if (holes > 0) {
    throw FileError(name, "has holes: " + std::to_string(holes) + " of " + std::to_string(z_.size()) +
                              " points lie below no triangle; close the model");
  }
  level();
  measure();
  find_crests();
}

// Moves the surface so that its flat part is at 0.
void HeightMap::level() {
  std::vector<float> outline;
  for (std::size_t row = 0; row < kRows; ++row) {
    const bool end = row == 0 || row + 1 == kRows;
    for (std::size_t column = 0; column < kColumns; column += end ? 1 : kColumns - 1)
      outline.push_back(at(row, column));
  }
  const float flat = median(outline);
  for (float& z : z_) {
    z -= flat;
    if (std::abs(double{z}) < kFlatMm) z = 0;
  }
}

double HeightMap::row_mean(std::size_t row) const {
  double sum = 0;
  for (std::size_t column = 0; column < kColumns; ++column) sum += double{at(row, column)};
  return sum / static_cast<double>(kColumns);
}

void HeightMap::measure() {
  extent_.texture_begin = extent_.texture_end = static_cast<double>(kRows - 1) * kCellMm / 2;
  bool textured = false;
  for (std::size_t row = 0; row < kRows; ++row) {
    const double mean = row_mean(row);
    const auto [low, high] = std::ranges::minmax(std::span(z_).subspan(row * kColumns, kColumns));
    extent_.max_height = std::max(extent_.max_height, double{high});
    extent_.min_height = std::min(extent_.min_height, double{low});
    if (double{high} - mean > kUniformMm || mean - double{low} > kUniformMm) extent_.uniform_in_x = false;
    if (low == 0 && high == 0) continue;
    if (!textured) extent_.texture_begin = static_cast<double>(std::max<std::size_t>(row, 1) - 1) * kCellMm;
    extent_.texture_end = static_cast<double>(std::min(row + 1, kRows - 1)) * kCellMm;
    textured = true;
  }
}

double HeightMap::operator()(double x_mm, double y_mm) const {
  const double u = x_mm / kCellMm, v = y_mm / kCellMm;
  const double last_u = static_cast<double>(kColumns - 1), last_v = static_cast<double>(kRows - 1);
  if (!(u >= 0 && u <= last_u && v >= 0 && v <= last_v)) return 0;
  const std::size_t column = std::min(static_cast<std::size_t>(u), kColumns - 2);
  const std::size_t row = std::min(static_cast<std::size_t>(v), kRows - 2);
  const double fu = u - static_cast<double>(column), fv = v - static_cast<double>(row);
  const auto along = [&](std::size_t r) {
    return double{at(r, column)} + fu * (double{at(r, column + 1)} - double{at(r, column)});
  };
  return along(row) + fv * (along(row + 1) - along(row));
}

void HeightMap::find_crests() {
  std::vector<double> profile(kRows);
  for (std::size_t row = 0; row < kRows; ++row) profile[row] = row_mean(row);
  const double half = *std::max_element(profile.begin(), profile.end()) / 2;
  if (half <= 0) return;
  for (std::size_t row = 0; row < kRows; ++row) {
    if (profile[row] <= half) continue;
    std::size_t end = row;
    while (end < kRows && profile[end] > half) ++end;
    const double top = *std::max_element(&profile[row], &profile[end - 1] + 1) - kFlatMm;
    std::size_t first = row, last = end - 1;
    while (profile[first] < top) ++first;
    while (profile[last] < top) --last;
    extent_.crests.push_back(static_cast<double>(first + last) * kCellMm / 2);
    row = end;
  }
}

}  // namespace supertac
