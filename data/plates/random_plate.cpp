// What random plates look like.
#include "data/plates/plate.h"

#include <algorithm>
#include <cmath>

#include "io/numbers/random.h"
#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

constexpr double kLeastPitchMm = 4, kMostPitchMm = 15, kLeastHeightMm = 0.5, kMostHeightMm = 3;

/// Random numbers one after the other.
class Draw {
 public:
  explicit Draw(std::uint32_t number) : random_(number, stream_named("plate")) {}
  double between(double low, double high) { return low + (high - low) * random_.uniform(next_++); }
  bool chance(double share) { return random_.uniform(next_++) < share; }
  int one_of(int count) { return static_cast<int>(random_.uniform(next_++) * count); }

 private:
  RandomStream random_;
  std::uint64_t next_ = 0;
};

enum class Form { ridge, half_round, hill };

/// A line across the plate, or something round.
struct Element {
  Form form = Form::ridge;
  bool line = true;
  double x_mm = 0, y_mm = 0;          // a point of the line, or the centre
  double across_x = 0, across_y = 1;  // unit vector across the line
  double width_mm = 0, height_mm = 0;

  double height(double x, double y) const {
    const double dx = x - x_mm, dy = y - y_mm;
    const double distance = line ? std::abs(dx * across_x + dy * across_y) : std::sqrt(dx * dx + dy * dy);
    const double r = 2 * distance / width_mm;
    if (r >= 1) return 0;
    if (form == Form::ridge) return height_mm * (1 - r);
    const double rest = 1 - r * r;
    return height_mm * (form == Form::hill ? rest * rest : std::sqrt(rest));
  }
  /// Half of its extent along y, over the whole plate.
  double reach_mm() const {
    return line ? (width_mm / 2 + std::abs(across_x) * rig::kPlateWidthMm / 2) / across_y : width_mm / 2;
  }
};

Plate made_of(std::vector<Element> elements, const std::string& name) {
  const double first_mm = elements.front().y_mm;
  PlateExtent extent{.texture_begin = first_mm, .texture_end = first_mm};
  for (const Element& e : elements) {
    extent.texture_begin = std::min(extent.texture_begin, std::max(0.0, e.y_mm - e.reach_mm()));
    extent.texture_end = std::max(extent.texture_end, std::min(rig::kPlateLengthMm, e.y_mm + e.reach_mm()));
    extent.max_height = std::max(extent.max_height, e.height_mm);
    extent.uniform_in_x = extent.uniform_in_x && e.line && e.across_x == 0;
    extent.crests.push_back(e.y_mm);
  }
  std::ranges::sort(extent.crests);
  const auto highest = [elements = std::move(elements)](double x_mm, double y_mm) {
    double z = 0;
    for (const Element& e : elements) z = std::max(z, e.height(x_mm, y_mm));
    return z;
  };
  return {name, highest, extent};
}

/// A line or a round element: more than half have the rig's size.
Element draw_element(Draw& draw, bool line) {
  Element e{.form = line && draw.chance(0.5) ? Form::ridge : Form::half_round, .line = line};
  const bool as_on_the_rig = draw.chance(0.6);
  e.height_mm = as_on_the_rig ? rig::kTextureHeightMm : draw.between(kLeastHeightMm, kMostHeightMm);
  const double usual = e.form == Form::ridge ? rig::kRidgeBaseMm : 2 * e.height_mm;
  e.width_mm = as_on_the_rig ? usual : draw.between(0.8, 1.6) * usual;
  return e;
}

/// Equal elements in rows.
Texture draw_texture(Draw& draw, double from_mm, double to_mm) {
  constexpr const char* kDrawn[] = {"ridges", "bumps", "ridges", "bumps", "blobs", "waves"};
  Texture t{.kind = kDrawn[draw.one_of(6)], .from_mm = from_mm, .to_mm = to_mm};
  t.pitch_mm = draw.between(kLeastPitchMm, std::min(kMostPitchMm, (to_mm - from_mm) / 1.2));
  t.height_mm = draw.chance(0.6) ? rig::kTextureHeightMm : draw.between(kLeastHeightMm, kMostHeightMm);
  const bool round = t.kind == "bumps" || t.kind == "blobs";
  if (round) t.height_mm = std::min(t.height_mm, t.pitch_mm / 2);
  return t;
}

/// Lines one behind the other, each as far from the last as it likes; all of one form and size, or mixed.
std::vector<Element> draw_lines(Draw& draw, double from_mm, double to_mm) {
  const double turn = draw.chance(0.4) ? draw.between(-0.11, 0.11) : 0;  // up to 40 degrees
  const bool mixed = draw.chance(0.5);
  Element element = draw_element(draw, true);
  std::vector<Element> lines;
  for (double y = from_mm + element.width_mm / 2; y < to_mm;) {
    element.x_mm = rig::kPlateWidthMm / 2, element.y_mm = y;
    element.across_x = same_bits::sine(turn), element.across_y = same_bits::cosine(turn);
    lines.push_back(element);
    if (mixed) element = draw_element(draw, true);
    y += std::max(element.width_mm, draw.between(kLeastPitchMm, kMostPitchMm));
  }
  return lines;
}

/// Round elements, or smooth hills that run into each other, anywhere.
std::vector<Element> draw_scattered(Draw& draw, double from_mm, double to_mm) {
  const bool hills = draw.chance(0.5);
  const int count = 4 + draw.one_of(24);
  std::vector<Element> elements;
  for (int i = 0; i < count; ++i) {
    Element e = draw_element(draw, false);
    if (hills) e.form = Form::hill, e.width_mm = draw.between(4, 12);
    e.x_mm = draw.between(0, rig::kPlateWidthMm), e.y_mm = draw.between(from_mm, to_mm);
    elements.push_back(e);
  }
  return elements;
}

}  // namespace

Plate random_plate(std::uint32_t number) {
  Draw draw(number);
  const double from = draw.between(30, 40), to = draw.between(60, 78), layout = draw.between(-1, 16);
  const std::string name = "random" + std::to_string(number);
  if (layout < 1) return {name, std::vector<Texture>{}};
  if (layout < 8) return {name, {draw_texture(draw, from, to)}};
  if (layout < 9.5) {
    const double middle = (from + to) / 2;
    return {name, {draw_texture(draw, from, middle), draw_texture(draw, middle, to)}};
  }
  if (layout < 13.5) return made_of(draw_lines(draw, from, to), name);
  if (layout < 14.5) {
    Element e = draw_element(draw, true);
    e.x_mm = rig::kPlateWidthMm / 2, e.y_mm = draw.between(from, to);
    return made_of({e}, name);
  }
  return made_of(draw_scattered(draw, from, to), name);
}

}  // namespace supertac
