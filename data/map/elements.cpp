#include "data/map/named_map.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "data/plates/truth.h"
#include "data/sensors/rig.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr float kSaddle = 0.5F;  // shares of a top: how high a saddle joins, and where a hill begins

// Each cell's hill, named by the cell of its top; nothing where none is. Cells are met from the highest down.
class Hills {
 public:
  Hills(const std::vector<float>& values, std::int64_t width)
      : values_(values), width_(width), parent_(values.size(), kNone) {
    std::vector<std::size_t> order;
    for (std::size_t c = 0; c < values.size(); ++c)
      if (values[c] >= kSaddle * kLowest) order.push_back(c);  // false for NaN
    std::ranges::stable_sort(order, std::greater{}, [&](std::size_t c) { return values[c]; });
    for (const std::size_t c : order) meet(c);
  }
  std::optional<std::size_t> top_of(std::size_t cell) {
    if (parent_[cell] == kNone) return std::nullopt;
    const std::size_t top = root(cell);
    if (values_[top] < kLowest || values_[cell] < kSaddle * values_[top]) return std::nullopt;
    return top;
  }
  // Calls f(neighbour), with nothing beyond the map's edge.
  template <typename F>
  void around(std::size_t cell, F&& f) const {
    const auto c = static_cast<std::int64_t>(cell), count = static_cast<std::int64_t>(values_.size());
    for (std::int64_t dy = -1; dy <= 1; ++dy) {
      for (std::int64_t dx = -1; dx <= 1; ++dx) {
        const std::int64_t x = c % width_ + dx, other = c + dy * width_ + dx;
        if (dx == 0 && dy == 0) continue;
        const bool inside = x >= 0 && x < width_ && other >= 0 && other < count;
        f(inside ? std::optional(static_cast<std::size_t>(other)) : std::nullopt);
      }
    }
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::size_t root(std::size_t cell) {
    while (parent_[cell] != cell) cell = parent_[cell] = parent_[parent_[cell]];
    return cell;
  }
  // The cell joins the highest hill beside it, and so do the hills whose saddle it is.
  void meet(std::size_t cell) {
    std::vector<std::size_t> roots;
    around(cell, [&](std::optional<std::size_t> other) {
      if (other && parent_[*other] != kNone) roots.push_back(root(*other));
    });
    if (roots.empty()) {
      parent_[cell] = cell;
      return;
    }
    const std::size_t highest = *std::ranges::max_element(
        roots, {}, [&](std::size_t r) { return std::pair(values_[r], values_.size() - r); });
    parent_[cell] = highest;
    for (const std::size_t r : roots)
      if (values_[cell] >= kSaddle * values_[r]) parent_[r] = highest;
  }

  const std::vector<float>& values_;
  std::int64_t width_;
  std::vector<std::size_t> parent_;  // towards the top; a top is its own
};

// Of the cells of one hill.
Element measured(const NamedMap& map, std::size_t top, const std::vector<std::size_t>& cells) {
  const MapCells& m = map.cells;
  const Pitch cell = map.cell_mm;
  const auto x = [&](std::size_t c) { return centre_of(map, c).first; };
  const auto y = [&](std::size_t c) { return centre_of(map, c).second; };
  const auto error = [&](std::size_t c) { return m.errors.empty() ? 0.0 : double{m.errors[c]}; };
  Element e{.height = m.values[top], .height_off = error(top)};
  double sum = 0, mean_x = 0, mean_y = 0;
  for (const std::size_t c : cells) {
    const double v = m.values[c];
    sum += v, e.x_mm += v * x(c), e.y_mm += v * y(c), mean_x += x(c), mean_y += y(c);
  }
  const auto count = static_cast<double>(cells.size());
  e.x_mm /= sum, e.y_mm /= sum, mean_x /= count, mean_y /= count;
  double xx = cell.x * cell.x / 12, yy = cell.y * cell.y / 12, xy = 0;  // those of a single cell
  for (const std::size_t c : cells) {
    e.x_off_mm += error(c) * std::abs(x(c) - e.x_mm) / sum;
    e.y_off_mm += error(c) * std::abs(y(c) - e.y_mm) / sum;
    const double dx = x(c) - mean_x, dy = y(c) - mean_y;
    xx += dx * dx / count, yy += dy * dy / count, xy += dx * dy / count;
  }
  // A bar of length l has the variance l^2 / 12 along itself.
  const double middle = (xx + yy) / 2, lean = (xx - yy) / 2, half = std::sqrt(lean * lean + xy * xy);
  e.length_mm = std::sqrt(12 * (middle + half)), e.width_mm = std::sqrt(12 * std::max(0.0, middle - half));
  const double cosine = half > 0 ? lean / half : 1;  // of twice the angle of its length
  e.along_x = std::sqrt((1 + cosine) / 2), e.along_y = std::copysign(std::sqrt((1 - cosine) / 2), xy);
  return e;
}

// Of two elements; of lines across the first.
double distance(const Element& a, const Element& b) {
  const double dx = b.x_mm - a.x_mm, dy = b.y_mm - a.y_mm;
  return a.line() ? std::abs(dy * a.along_x - dx * a.along_y) : std::sqrt(dx * dx + dy * dy);
}

}  // namespace

std::vector<std::pair<const char*, double>> numbers_of(const Element& e) {
  return {{"x_mm", e.x_mm},
          {"y_mm", e.y_mm},
          {"x_off_mm", e.x_off_mm},
          {"y_off_mm", e.y_off_mm},
          {"height", e.height},
          {"height_off", e.height_off},
          {"length_mm", e.length_mm},
          {"width_mm", e.width_mm},
          {"degrees", std::atan2(e.along_y, e.along_x) * 180 / std::numbers::pi},
          {"open", e.open ? 1 : 0}};
}

std::vector<Element> elements(const NamedMap& map) {
  const std::vector<float>& values = map.cells.values;
  Hills hills(values, std::max<std::int64_t>(1, map.cells.region.width));
  std::map<std::size_t, std::vector<std::size_t>> cells;
  for (std::size_t c = 0; c < values.size(); ++c)
    if (const auto top = hills.top_of(c)) cells[*top].push_back(c);
  std::vector<Element> found;
  for (const auto& [top, of_top] : cells) {
    Element e = measured(map, top, of_top);
    if (e.height <= e.height_off) continue;
    for (const std::size_t c : of_top)
      hills.around(c, [&](auto other) { e.open = e.open || !other || std::isnan(values[*other]); });
    found.push_back(e);
  }
  std::ranges::sort(found, {}, [](const Element& e) { return std::pair(e.y_mm, e.x_mm); });
  return found;
}

double pitch_mm(const std::vector<Element>& elements) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    std::vector<double> others;
    for (std::size_t k = 0; k < elements.size(); ++k)
      if (k != i) others.push_back(distance(elements[i], elements[k]));
    if (!others.empty()) nearest.push_back(std::ranges::min(others));
  }
  return nearest.empty() ? std::nan("") : median(nearest);
}

std::string elements_text(const NamedMap& map) {
  const std::vector<Element> found = elements(map);
  const double pitch = pitch_mm(found);
  return std::to_string(found.size()) + (found.size() == 1 ? " element" : " elements") +
         (std::isfinite(pitch) ? ", " + format(pitch, 2) + " mm apart" : "") +
         (map.kind.empty() ? ""
                           : ", most like " + map.kind + ", which explain " +
                                 format(100 * map.kind_share, 0) + " % of it");
}

std::vector<Plate> kinds_of_elements(const std::string& name) {
  if (name == kAnyKind) {
    std::vector<Plate> all;
    for (const char* one : {"bumps", "ridges", "blobs"}) all.push_back(kinds_of_elements(one).front());
    return all;
  }
  const bool word = std::ranges::all_of(name, [](char c) { return c >= 'a' && c <= 'z'; });
  Plate kind = Plate::named(word ? name + format(rig::kTextureToMm - rig::kTextureFromMm, 0) : name);
  if (kind.crests().size() != 1 || kind.min_height() < 0)
    throw std::invalid_argument(
        "elements: expected bumps, ridges, blobs or any, or a plate with one element in its "
        "middle, found " +
        name + ", whose plate has " + std::to_string(kind.crests().size()) +
        (kind.min_height() < 0 ? " and troughs" : ""));
  return {kind};
}

const Plate& recognise(NamedMap& map, const std::vector<Plate>& kinds) {
  const std::vector<Element> found = elements(map);
  const Plate* alike = &kinds.front();
  double least = std::numeric_limits<double>::infinity();
  for (const Plate& kind : kinds) {
    const Plate plate = plate_of(found, kind);
    double squares = 0, high = 0, within = 0;
    for (std::size_t c = 0; c < map.cells.values.size(); ++c) {
      const double value = map.cells.values[c];
      if (std::isnan(value)) continue;
      const auto [x, y] = centre_of(map, c);
      const double drawn = truth_value(plate, x, y), off = std::abs(drawn - value);
      squares += off * off;
      if (std::max(drawn, value) < kSaddle * kLowest) continue;
      high += 1, within += map.cells.errors.empty() || off <= map.cells.errors[c] ? 1 : 0;
    }
    if (squares >= least) continue;
    least = squares, alike = &kind, map.kind_share = high > 0 ? within / high : 0;
  }
  if (!found.empty()) map.kind = alike->textures().empty() ? alike->name() : alike->textures()[0].kind;
  return *alike;
}

Plate plate_of(const std::vector<Element>& found, const Plate& kind) {
  const auto highest = [found, kind](double x_mm, double y_mm) {
    double z = 0;
    for (const Element& e : found)
      z = std::max(
          z, kind.height(rig::kPlateWidthMm / 2 + x_mm - e.x_mm, rig::kPlateLengthMm / 2 + y_mm - e.y_mm));
    return z;
  };
  return {"stated", highest, {.max_height = kind.max_height(), .uniform_in_x = kind.uniform_in_x()}};
}

void draw_as(NamedMap& map, const std::vector<Plate>& kinds) {
  const std::vector<Element> found = elements(map);
  const Plate& kind = recognise(map, kinds);
  const Plate drawn = plate_of(found, kind);
  std::vector<Plate> moved;
  for (const double x : {-1, 1}) {
    for (const double y : {-1, 1}) {
      std::vector<Element> places = found;
      for (Element& e : places) e.x_mm += x * e.x_off_mm, e.y_mm += y * e.y_off_mm;
      moved.push_back(plate_of(places, kind));
    }
  }
  map.cells.errors.assign(map.cells.values.size(), std::nanf(""));
  for (std::size_t c = 0; c < map.cells.values.size(); ++c) {
    if (std::isnan(map.cells.values[c])) continue;
    const auto [x, y] = centre_of(map, c);
    const double value = truth_value(drawn, x, y);
    double most = 0;
    for (const Plate& plate : moved) most = std::max(most, std::abs(truth_value(plate, x, y) - value));
    map.cells.values[c] = static_cast<float>(value), map.cells.errors[c] = static_cast<float>(most);
  }
}

void ElementScores::add(const NamedMap& map) {
  NamedMap truth = map;
  truth.cells.values = map.truth, truth.cells.errors.clear();
  for (std::size_t c = 0; c < map.truth.size(); ++c)
    if (std::isnan(map.cells.values[c])) truth.cells.values[c] = map.cells.values[c];
  std::vector<Element> left = elements(map);
  const std::vector<Element> there = elements(truth);
  if (left.size() > 1 && there.size() > 1)
    pitch_errors_mm.push_back(std::abs(pitch_mm(left) - pitch_mm(there)));
  for (const Element& wanted : there) {
    ++existing;
    const auto nearest =
        std::ranges::min_element(left, {}, [&](const Element& e) { return distance(wanted, e); });
    if (nearest == left.end() || distance(wanted, *nearest) > kFoundMm) continue;
    ++found;
    distances_mm.push_back(distance(wanted, *nearest));
    left.erase(nearest);
  }
  invented += left.size();
}

}  // namespace supertac
