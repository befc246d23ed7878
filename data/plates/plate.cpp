#include "data/plates/plate.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string_view>

#include "data/plates/stl.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {

namespace {

/// All that is particular to a texture. One row of kKinds adds one; nothing else names it.
struct TextureKind {
  std::string_view word;            // in a plate's name, before the pitch
  double (*width)(const Texture&);  // of an element (mm)
  /// Height (mm) at (dx, dy) from the centre of the nearest element; dx is 0 for a texture of lines along x.
  double (*height)(const Texture&, double dx, double dy);
  bool lines = true;   // along x: the height depends on y only
  bool round = false;  // half as high as wide, so that the height is at most half the pitch
  double lowest = 0;   // trough, in heights
};

constexpr std::string_view kRandom = "random";  // and a number: a plate's name
constexpr double kFinestMm = 0.05, kWidestMm = 1000;
constexpr double kFitSlackMm = 1e-9;  // an element that fits exactly still fits after rounding

// Widths of an element, and heights at (dx, dy) from its centre.
double ridge_base(const Texture& t) { return std::min(rig::kRidgeBaseMm, t.pitch_mm); }
double ridge(const Texture& t, double, double dy) {
  return t.height_mm * std::max(0.0, 1 - 2 * std::abs(dy) / ridge_base(t));
}

double diameter(const Texture& t) { return 2 * t.height_mm; }
double half_round(const Texture& t, double dx, double dy) {
  return std::sqrt(std::max(0.0, t.height_mm * t.height_mm - (dx * dx + dy * dy)));
}

double half_pitch(const Texture& t) { return t.pitch_mm / 2; }  // a crest: troughs lie between crests
double wave(const Texture& t, double, double dy) { return t.height_mm * same_bits::cosine(dy / t.pitch_mm); }

constexpr TextureKind kKinds[] = {
    {.word = "ridges", .width = ridge_base, .height = ridge},
    {.word = "bumps", .width = diameter, .height = half_round, .round = true},
    {.word = "waves", .width = half_pitch, .height = wave, .lowest = -1},
    {.word = "blobs", .width = diameter, .height = half_round, .lines = false, .round = true}};

constexpr std::pair<const char*, const char*> kRigPlates[] = {
    {"3_Bumps", "bumps12"}, {"6_Bumps", "bumps6"}, {"4_Ridges", "ridges9"}, {"6_Ridges", "ridges6"},
    {"4_Waves", "waves9"},  {"6_Waves", "waves6"}, {"4_Blob", "blobs9"},    {"6_Blob", "blobs6"}};

int elements_that_fit(double length, double pitch, double width) {
  if (length + kFitSlackMm < width) return 0;
  return static_cast<int>(std::floor((length - width + kFitSlackMm) / pitch)) + 1;
}

// Distance from `at` to the nearest of `count` centres.
double distance_to_nearest(double at, double first, double pitch, int count) {
  const double index = std::clamp(std::round((at - first) / pitch), 0.0, count - 1.0);
  return at - (first + index * pitch);
}

// One texture with its layout worked out.
struct Band {
  const TextureKind* kind;
  Texture texture;
  int count_y, count_x;
  double first_y, first_x;  // centre of the first element
  double begin, end;        // extent along y

  Band(const Texture& t, const TextureKind& k) : kind(&k), texture(t) {
    const double width = k.width(t), pitch = t.pitch_mm;
    count_y = elements_that_fit(t.to_mm - t.from_mm, pitch, width);
    count_x = elements_that_fit(rig::kPlateWidthMm, pitch, width);
    first_y = (t.from_mm + t.to_mm) / 2 - (count_y - 1) * pitch / 2;
    first_x = rig::kPlateWidthMm / 2 - (count_x - 1) * pitch / 2;
    begin = first_y - width / 2;
    end = first_y + (count_y - 1) * pitch + width / 2;
  }
  double height(double x_mm, double y_mm) const {
    if (y_mm <= begin || y_mm >= end) return 0;
    const double dy = distance_to_nearest(y_mm, first_y, texture.pitch_mm, count_y);
    const double dx = kind->lines ? 0 : distance_to_nearest(x_mm, first_x, texture.pitch_mm, count_x);
    return kind->height(texture, dx, dy);
  }
};

PlateExtent extent_of(const std::vector<Band>& bands) {
  const double middle = rig::kPlateLengthMm / 2;
  PlateExtent e{.texture_begin = bands.empty() ? middle : bands.front().begin,
                .texture_end = bands.empty() ? middle : bands.front().end};
  for (const Band& band : bands) {
    e.texture_begin = std::min(e.texture_begin, band.begin),
    e.texture_end = std::max(e.texture_end, band.end);
    e.max_height = std::max(e.max_height, band.texture.height_mm);
    e.min_height = std::min(e.min_height, band.kind->lowest * band.texture.height_mm);
    e.uniform_in_x = e.uniform_in_x && band.kind->lines;
    for (int i = 0; i < band.count_y; ++i) e.crests.push_back(band.first_y + i * band.texture.pitch_mm);
  }
  std::ranges::sort(e.crests);
  return e;
}

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw std::invalid_argument("plate \"" + name + "\": " + why +
                              "; expected a rig plate such as 3_Bumps, or plain, or " +
                              joined(kKinds, "|", &TextureKind::word) +
                              " with a pitch in mm such as bumps12 or ridges6h1.5, several joined by +, or "
                              "random and a number, or an STL file");
}

// Reads a number at the front of `text` and removes it.
double take_number(std::string_view& text, const std::string& name, const char* what) {
  double value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
  if (error != std::errc()) refuse(name, std::string("no ") + what + " at \"" + std::string(text) + "\"");
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

// The kind whose word `text` begins with; nothing for plain.
const TextureKind* kind_of(std::string_view text, const std::string& name) {
  if (text == "plain") return nullptr;
  for (const TextureKind& kind : kKinds)
    if (text.starts_with(kind.word)) return &kind;
  refuse(name, "unknown texture \"" + std::string(text) + "\"");
}

Texture parse_texture(std::string_view text, const std::string& name) {
  const TextureKind* kind = kind_of(text, name);
  if (kind == nullptr) return {};
  text.remove_prefix(kind->word.size());
  Texture t{.kind = std::string(kind->word), .pitch_mm = take_number(text, name, "pitch")};
  t.height_mm = kind->round ? std::min(rig::kTextureHeightMm, t.pitch_mm / 2) : rig::kTextureHeightMm;
  if (text.starts_with('h')) {
    text.remove_prefix(1);
    t.height_mm = take_number(text, name, "height");
  }
  if (!text.empty()) refuse(name, "cannot read \"" + std::string(text) + "\"");
  return t;
}

}  // namespace

bool Plate::is_file(const std::string& name) {
  return name.size() > 4 &&
         std::ranges::equal(name.substr(name.size() - 4), std::string_view(".stl"), {}, lower);
}

Plate Plate::named(const std::string& name) {
  if (is_file(name)) {
    const HeightMap map(read_stl(name), name);
    return {std::filesystem::path(name).filename().string(), map, map.extent()};
  }
  if (name.starts_with(kRandom))
    if (const auto number = parse_uint(name.substr(kRandom.size())); number && *number <= UINT32_MAX)
      return random_plate(static_cast<std::uint32_t>(*number));
  const auto* of_rig =
      std::ranges::find(kRigPlates, name, [](const auto& row) { return std::string_view(row.first); });
  const std::string generic = of_rig != std::end(kRigPlates) ? of_rig->second : name;
  std::vector<Texture> textures;
  for (std::size_t begin = 0; begin <= generic.size();) {
    const std::size_t end = std::min(generic.find('+', begin), generic.size());
    textures.push_back(parse_texture(std::string_view(generic).substr(begin, end - begin), name));
    begin = end + 1;
  }
  const double share = (rig::kTextureToMm - rig::kTextureFromMm) / static_cast<double>(textures.size());
  for (std::size_t i = 0; i < textures.size(); ++i) {
    textures[i].from_mm = rig::kTextureFromMm + share * static_cast<double>(i);
    textures[i].to_mm = textures[i].from_mm + share;
  }
  return Plate(name, textures);
}

Plate::Plate(std::string name, const std::vector<Texture>& textures) : name_(std::move(name)) {
  std::vector<Band> bands;
  for (const Texture& texture : textures) {
    const TextureKind* kind = kind_of(texture.kind, name_);
    if (kind == nullptr) continue;
    if (!(texture.pitch_mm > 0) || !(texture.height_mm > 0))
      refuse(name_, "pitch and height must be positive");
    // Finer than any finger feels or printer prints, or wider than any plate: a mistyped name.
    if (!(texture.pitch_mm >= kFinestMm && texture.pitch_mm <= kWidestMm && texture.height_mm <= kWidestMm))
      refuse(name_, "pitch and height must be numbers from 0.05 to 1000 mm");
    if (kind->round && 2 * texture.height_mm > texture.pitch_mm + kFitSlackMm)
      refuse(name_, texture.kind + " are twice as wide as high and overlap at this pitch");
    bands.emplace_back(texture, *kind);
    if (bands.back().count_y < 1) refuse(name_, "no element fits between its ends");
    textures_.push_back(texture);
  }
  extent_ = extent_of(bands);
  surface_ = std::make_shared<const Surface>([bands = std::move(bands)](double x_mm, double y_mm) {
    double z = 0;  // textures do not overlap, so at most one term differs from 0
    for (const Band& band : bands) z += band.height(x_mm, y_mm);
    return z;
  });
}

Plate::Plate(std::string name, Surface surface, PlateExtent extent)
    : name_(std::move(name)),
      surface_(std::make_shared<const Surface>(std::move(surface))),
      extent_(std::move(extent)) {}

bool resemble(const Plate& a, const Plate& b) {
  constexpr double kSamePitchMm = 0.5;
  for (const Texture& t : a.textures())
    for (const Texture& u : b.textures())
      if (t.kind == u.kind && std::abs(t.pitch_mm - u.pitch_mm) < kSamePitchMm) return true;
  return false;
}

bool is_unknown_plate(const std::string& name) { return name.starts_with("unknown"); }

Plate plate_in_folder(const std::string& name, const std::string& folder) {
  if (is_unknown_plate(name))
    throw std::invalid_argument(
        "these signals have no truth to train on or score. Learn from simulated presses (supertac-simulate "
        "--sensor FILE --presses N), film what presses (supertac-import --truth), or slide over a plate that "
        "is known (supertac-import --plate NAME)");
  if (!Plate::is_file(name)) return Plate::named(name);
  if (name.find('/') != std::string::npos)
    throw std::invalid_argument("plate " + in_quotes(name) +
                                ": expected the name of an STL file beside the recordings, found a path");
  return Plate::named((std::filesystem::path(folder) / name).string());
}

void keep_plate_file(const std::string& path, const std::string& folder) {
  if (!Plate::is_file(path)) return;
  const auto bytes = read_file(path, kMaxStlBytes);
  const std::string copy = (std::filesystem::path(folder) / std::filesystem::path(path).filename()).string();
  if (std::filesystem::exists(copy)) {
    if (read_file(copy, kMaxStlBytes) == bytes) return;
    throw FileError(copy, "is another plate than " + path + "; rename one of them or choose another folder");
  }
  write_file(copy, bytes);
}

}  // namespace supertac
