// What presses an array.
#include "data/simulation/presses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

enum Kind { kDisc, kBar, kRing, kEdge, kLetter, kFingertip, kMixed, kSurface };
// Surfaces from grains to hills as large as the array, as many as other kinds.
constexpr int kSurfaces = 7;
const std::vector<std::string> kKinds = {"disc",      "bar",      "ring",     "edge",     "letter",
                                         "fingertip", "mixed",    "surface1", "surface2", "surface3",
                                         "surface4",  "surface5", "surface6", "surface7"};

// Of none, one, two, three and four contacts: shares of all scenes up to each.
constexpr std::array<double, 4> kCounts = {0.1, 0.45, 0.75, 0.9};

constexpr std::uint64_t kNumbersOfAContact = 64;
enum Draw : std::uint64_t {
  kCount,
  kOfKind = 0,
  kX,
  kY,
  kTurn,
  kSize,
  kOther,
  kSoft,
  kMost,
  kDown,
  kUp,
  kMoves,
  kWhere,
  kSpeed,
  kShape,
  kWaves = 4096  // behind the numbers of all contacts
};

constexpr double kSmallest = 0.5, kLargest = 2.5;  // sizes, in pitches
constexpr double kHardEdge = 0.1;                  // of the size: how far the pressure takes to grow

// A surface: so many waves, from half a pitch to at most twice the array, whose heights fall with the length
// by the power 0 (noise) to 1.5 (hills); what lies up to 1.5 deviations above or below the mean touches.
constexpr std::uint64_t kWavesOfASurface = 32;
constexpr double kShortestWave = 0.5, kSteepest = 1.5, kLevel = 1.5, kPeak = 3;

// Strokes x, y, x, y in a square of -1 to 1.
const std::vector<std::vector<double>> kLetters = {
    {-0.6, -1, -0.6, 1, -0.6, 1, 0.7, 1},                      // L
    {-0.8, -1, 0.8, -1, 0, -1, 0, 1},                          // T
    {-0.8, -1, 0.8, 1, -0.8, 1, 0.8, -1},                      // X
    {-0.8, -1, 0, 1, 0, 1, 0.8, -1},                           // V
    {-0.7, -1, -0.7, 1, 0.7, -1, 0.7, 1, -0.7, 0, 0.7, 0},     // H
    {-0.8, -1, 0.8, -1, 0.8, -1, -0.8, 1, -0.8, 1, 0.8, 1},    // Z
    {-0.7, -1, -0.7, 1, 0.7, -1, 0.7, 1, -0.7, 1, 0.7, 1},     // U
    {-0.6, -1, -0.6, 1, -0.6, -1, 0.7, -1, -0.6, 0, 0.5, 0}};  // F

double distance_to_stroke(const double* stroke, double x, double y) {
  const double dx = stroke[2] - stroke[0], dy = stroke[3] - stroke[1];
  const double along =
      std::clamp(((x - stroke[0]) * dx + (y - stroke[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
  const double ax = x - stroke[0] - along * dx, ay = y - stroke[1] - along * dy;
  return std::sqrt(ax * ax + ay * ay);
}

// A Gaussian random field of standard deviation 1 whose spectrum is a power law (self-affine, as rough
// surfaces are) and whose longest wave is `size` of the way from one pitch to twice the array.
std::vector<Scene::Wave> draw_waves(double size, double pitch, double length, const RandomStream& random,
                                    std::uint64_t first) {
  const double shortest = kShortestWave * pitch,
               longest = 2 * shortest * same_bits::pow(length / shortest, size);
  const double steepness = kSteepest * random.uniform(first);
  std::vector<Scene::Wave> waves;
  double squares = 0;
  for (std::uint64_t k = first + 1; k <= first + 3 * kWavesOfASurface; k += 3) {
    const double mm = shortest * same_bits::pow(longest / shortest, random.uniform(k)),
                 turn = random.uniform(k + 1);
    waves.push_back({.x_per_mm = same_bits::cosine(turn) / mm,
                     .y_per_mm = same_bits::sine(turn) / mm,
                     .phase = random.uniform(k + 2),
                     .height = same_bits::pow(mm / longest, steepness)});
    squares += waves.back().height * waves.back().height / 2;
  }
  for (Scene::Wave& wave : waves) wave.height /= std::sqrt(squares);
  return waves;
}

Scene::Contact draw(int kind, const Scene::Objects& objects, const TaxelArray& array,
                    const RandomStream& random, std::uint64_t first) {
  const auto uniform = [&](std::uint64_t number) { return random.uniform(first + number); };
  const double pitch = std::sqrt(array.pitch_mm.x * array.pitch_mm.y);
  const double width = array.columns * array.pitch_mm.x, height = array.rows * array.pitch_mm.y;
  const double largest = std::min(kLargest * pitch, std::max(width, height) / 3);
  Scene::Contact c;
  c.kind = kind;
  c.x_mm = width * (uniform(kX) - 0.5), c.y_mm = height * (uniform(kY) - 0.5);
  c.cosine = same_bits::cosine(uniform(kTurn)), c.sine = same_bits::sine(uniform(kTurn));
  c.size_mm =
      std::lerp(kSmallest * pitch, largest, std::lerp(objects.smallest, objects.largest, uniform(kSize)));
  c.other_mm = std::lerp(kSmallest * pitch / 2, c.size_mm, uniform(kOther) / 2);
  if (kind == kFingertip) c.other_mm = c.size_mm * std::lerp(0.6, 1.0, uniform(kOther));
  const double middle = kind == kBar || kind == kRing || kind == kLetter ? c.other_mm / 2 : c.size_mm;
  const double softest = kind == kFingertip ? 1 : uniform(kSoft);
  c.edge_mm = std::max(kHardEdge * c.size_mm, middle * softest);
  c.most = std::lerp(0.15, 1.0, uniform(kMost));
  c.down_s = 0.3 * uniform(kDown), c.loaded_s = c.down_s + std::lerp(0.03, 0.3, uniform(kDown + 20));
  c.up_s = Scene::kSeconds - 0.2 * uniform(kUp),
  c.lifting_s = c.up_s - std::lerp(0.03, 0.3, uniform(kUp + 20));
  if (uniform(kMoves) < 0.4) {
    const double speed = 2 * pitch * uniform(kSpeed);
    c.move_x_mm_s = speed * same_bits::cosine(uniform(kWhere));
    c.move_y_mm_s = speed * same_bits::sine(uniform(kWhere));
  }
  if (kind == kLetter) c.shape = kLetters[static_cast<std::size_t>(uniform(kShape) * 8)];
  if (kind >= kSurface) {
    const double level = kLevel * (2 * uniform(kShape) - 1);
    c.size_mm = level, c.edge_mm = kPeak + level;  // heights, in standard deviations
    c.waves = draw_waves((kind - kSurface + uniform(kSize)) / kSurfaces, pitch, std::max(width, height),
                         random, kWaves + 8 * first);
  }
  return c;
}

// Heights [rows][columns] of a contact's waves: of each, cos(x + y) = cos x cos y - sin x sin y.
std::vector<double> heights(const Scene::Contact& c, double x0_mm, double y0_mm, const Field& field) {
  std::vector<double> heights(field.cells());
  for (const Scene::Wave& wave : c.waves) {
    std::vector<double> cosines, sines;
    for (int column = 0; column < field.columns; ++column) {
      const double turns = wave.x_per_mm * (field.x_mm(column) - x0_mm) + wave.phase;
      cosines.push_back(wave.height * same_bits::cosine(turns));
      sines.push_back(wave.height * same_bits::sine(turns));
    }
    auto height = heights.begin();
    for (int row = 0; row < field.rows; ++row) {
      const double turns = wave.y_per_mm * (field.y_mm(row) - y0_mm);
      const double cosine = same_bits::cosine(turns), sine = same_bits::sine(turns);
      for (std::size_t i = 0; i < cosines.size(); ++i) *height++ += cosines[i] * cosine - sines[i] * sine;
    }
  }
  return heights;
}

// How far within the outline a point lies (x, y from the object's middle, turned with it), below 0 outside.
double inside_mm(const Scene::Contact& c, double x, double y) {
  const double from_middle = std::sqrt(x * x + y * y);
  switch (c.kind) {
    case kBar: {
      const double ends[] = {-c.size_mm, 0, c.size_mm, 0};
      return c.other_mm / 2 - distance_to_stroke(ends, x, y);
    }
    case kRing:
      return c.other_mm / 2 - std::abs(from_middle - c.size_mm);
    case kEdge:
      return x;
    case kLetter: {
      double nearest = c.size_mm;
      for (std::size_t i = 0; i < c.shape.size(); i += 4)
        nearest = std::min(nearest, distance_to_stroke(&c.shape[i], x / c.size_mm, y / c.size_mm));
      return c.other_mm / 2 - nearest * c.size_mm;
    }
    case kFingertip: {
      const double stretched = std::sqrt(x * x + y * y * (c.size_mm / c.other_mm) * (c.size_mm / c.other_mm));
      return c.size_mm - stretched;
    }
    default:
      return c.size_mm - from_middle;
  }
}

}  // namespace

const std::vector<std::string>& press_kinds() { return kKinds; }

Scene::Scene(const Objects& objects, const TaxelArray& array, const RandomStream& random) {
  const auto found = std::ranges::find(kKinds, objects.kind);
  if (found == kKinds.end())
    throw std::invalid_argument(
        refusal("presses", "kind", "one of " + joined(kKinds, ", "), in_quotes(objects.kind)));
  const auto named = static_cast<int>(found - kKinds.begin());
  const double u = random.uniform(kCount);
  const auto count = static_cast<std::uint64_t>(std::ranges::upper_bound(kCounts, u) - kCounts.begin());
  for (std::uint64_t i = 1; i <= count; ++i) {
    const std::uint64_t first = i * kNumbersOfAContact;
    const int one = named == kMixed
                        ? static_cast<int>(random.uniform(first + kOfKind) * static_cast<int>(kMixed))
                        : named;
    contacts_.push_back(draw(one, objects, array, random, first));
  }
}

void Scene::pressure(double t, const Body& body, double give_mm, const Field& field,
                     std::span<double> pressure) const {
  std::ranges::fill(pressure, 0.0);
  for (const Contact& c : contacts_) {
    const double down = std::clamp((t - c.down_s) / (c.loaded_s - c.down_s), 0.0, 1.0),
                 up = std::clamp((c.up_s - t) / (c.up_s - c.lifting_s), 0.0, 1.0);
    const double depth = c.most * std::min(down, up);
    if (depth <= 0) continue;
    const double x0 = c.x_mm + c.move_x_mm_s * t, y0 = c.y_mm + c.move_y_mm_s * t;
    const std::vector<double> of_waves = !c.waves.empty() ? heights(c, x0, y0, field) : std::vector<double>{};
    const auto each = [&](auto use) {
      for (int row = 0; row < field.rows; ++row)
        for (int column = 0; column < field.columns; ++column) {
          const double x = field.x_mm(column) - x0, y = field.y_mm(row) - y0;
          const double within =
              of_waves.empty() ? inside_mm(c, x * c.cosine + y * c.sine, y * c.cosine - x * c.sine)
                               : c.size_mm + of_waves[static_cast<std::size_t>(row * field.columns + column)];
          if (within > 0) use(row, column, std::min(1.0, within / c.edge_mm));
        }
    };
    double foremost = INFINITY;
    const bool round = body.shape != BodyShape::flat;
    if (round)
      each([&](int row, int column, double) {
        foremost = std::min(foremost, body.depth_mm(field.x_mm(column), field.y_mm(row)));
      });
    each([&](int row, int column, double grown) {
      // As round as a ball pressed into a foam: the slope ends where the object is flat.
      const double profile = grown * (2 - grown);
      const double behind =
          round ? (body.depth_mm(field.x_mm(column), field.y_mm(row)) - foremost) / give_mm : 0;
      double& cell = pressure[static_cast<std::size_t>(row * field.columns + column)];
      cell = std::max(cell, depth * profile - behind);
    });
  }
}

}  // namespace supertac
