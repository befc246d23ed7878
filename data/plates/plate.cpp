#include "data/plates/plate.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string_view>

#include "io/same_bits.h"

namespace supertac {
namespace {

constexpr double kFitSlackMm = 1e-9;  // an element that fits exactly still fits after rounding

double ridge_base(const Texture& t) { return std::min(rig::kRidgeBaseMm, t.pitch_mm); }

double element_width(const Texture& t) {
  switch (t.kind) {
    case TextureKind::ridges:
      return ridge_base(t);
    case TextureKind::waves:
      return t.pitch_mm / 2;  // a crest: the band ends with one on either side
    default:
      return 2 * t.height_mm;
  }
}

int elements_that_fit(double length, double pitch, double width) {
  if (length + kFitSlackMm < width) return 0;
  return static_cast<int>(std::floor((length - width + kFitSlackMm) / pitch)) + 1;
}

double semicircle(double radius, double squared_distance) {
  return std::sqrt(std::max(0.0, radius * radius - squared_distance));
}

// Distance from `at` to the nearest of `count` centres.
double distance_to_nearest(double at, double first, double pitch, int count) {
  const double index = std::clamp(std::round((at - first) / pitch), 0.0, count - 1.0);
  return at - (first + index * pitch);
}

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw std::invalid_argument(
      "plate \"" + name + "\": " + why +
      "; expected a rig plate such as 3_Bumps, or plain, or ridges|bumps|waves|blobs with "
      "a pitch in mm such as bumps12 or ridges6h1.5, several joined by +, or an STL file");
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

Texture parse_texture(std::string_view text, const std::string& name) {
  static constexpr std::pair<std::string_view, TextureKind> kKinds[] = {{"ridges", TextureKind::ridges},
                                                                        {"bumps", TextureKind::bumps},
                                                                        {"waves", TextureKind::waves},
                                                                        {"blobs", TextureKind::blobs}};
  if (text == "plain") return {};
  for (const auto& [word, kind] : kKinds) {
    if (!text.starts_with(word)) continue;
    text.remove_prefix(word.size());
    Texture t{.kind = kind, .pitch_mm = take_number(text, name, "pitch"), .height_mm = rig::kTextureHeightMm};
    const bool round = kind == TextureKind::bumps || kind == TextureKind::blobs;
    if (round) t.height_mm = std::min(rig::kTextureHeightMm, t.pitch_mm / 2);
    if (text.starts_with('h')) {
      text.remove_prefix(1);
      t.height_mm = take_number(text, name, "height");
    }
    if (!text.empty()) refuse(name, "cannot read \"" + std::string(text) + "\"");
    return t;
  }
  refuse(name, "unknown texture \"" + std::string(text) + "\"");
}

std::string generic_name(const std::string& name) {
  static const std::map<std::string, std::string> kRig = {
      {"3_Bumps", "bumps12"}, {"6_Bumps", "bumps6"}, {"4_Ridges", "ridges9"}, {"6_Ridges", "ridges6"},
      {"4_Waves", "waves9"},  {"6_Waves", "waves6"}, {"4_Blob", "blobs9"},    {"6_Blob", "blobs6"}};
  const auto found = kRig.find(name);
  return found == kRig.end() ? name : found->second;
}

}  // namespace

bool Plate::is_file(const std::string& name) { return name.ends_with(".stl") || name.ends_with(".STL"); }

Plate Plate::named(const std::string& name) {
  if (is_file(name))
    return {std::filesystem::path(name).filename().string(),
            HeightMap(read_stl(name), kWidthMm, kLengthMm, name)};
  const std::string generic = generic_name(name);
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
  texture_begin_ = texture_end_ = kLengthMm / 2;
  for (const Texture& texture : textures) {
    if (texture.kind == TextureKind::plain) continue;
    if (!(texture.pitch_mm > 0) || !(texture.height_mm > 0))
      refuse(name_, "pitch and height must be positive");
    const bool round = texture.kind == TextureKind::bumps || texture.kind == TextureKind::blobs;
    if (round && 2 * texture.height_mm > texture.pitch_mm + kFitSlackMm)
      refuse(name_, "bumps and blobs are twice as wide as high and overlap at this pitch");
    const Band band = lay_out(texture);
    if (band.count_y < 1) refuse(name_, "no element fits between its ends");
    texture_begin_ = bands_.empty() ? band.begin : std::min(texture_begin_, band.begin);
    texture_end_ = bands_.empty() ? band.end : std::max(texture_end_, band.end);
    max_height_ = std::max(max_height_, texture.height_mm);
    if (texture.kind == TextureKind::waves) min_height_ = std::min(min_height_, -texture.height_mm);
    bands_.push_back(band);
  }
}

Plate::Plate(std::string name, HeightMap map)
    : name_(std::move(name)),
      map_(std::make_shared<const HeightMap>(std::move(map))),
      max_height_(map_->max_height()),
      min_height_(map_->min_height()),
      texture_begin_(map_->texture_begin()),
      texture_end_(map_->texture_end()) {}

Plate::Band Plate::lay_out(const Texture& texture) {
  Band band{.texture = texture};
  const double width = element_width(texture), pitch = texture.pitch_mm;
  band.count_y = elements_that_fit(texture.to_mm - texture.from_mm, pitch, width);
  band.count_x = elements_that_fit(kWidthMm, pitch, width);
  band.first_y = (texture.from_mm + texture.to_mm) / 2 - (band.count_y - 1) * pitch / 2;
  band.first_x = kWidthMm / 2 - (band.count_x - 1) * pitch / 2;
  band.begin = band.first_y - width / 2;
  band.end = band.first_y + (band.count_y - 1) * pitch + width / 2;
  return band;
}

double Plate::Band::height(double x_mm, double y_mm) const {
  if (y_mm <= begin || y_mm >= end) return 0;
  const double h = texture.height_mm;
  const double dy = distance_to_nearest(y_mm, first_y, texture.pitch_mm, count_y);
  switch (texture.kind) {
    case TextureKind::ridges:
      return h * std::max(0.0, 1 - 2 * std::abs(dy) / ridge_base(texture));
    case TextureKind::bumps:
      return semicircle(h, dy * dy);
    case TextureKind::waves:
      return h * same_bits::cosine(dy / texture.pitch_mm);
    case TextureKind::blobs: {
      const double dx = distance_to_nearest(x_mm, first_x, texture.pitch_mm, count_x);
      return semicircle(h, dx * dx + dy * dy);
    }
    case TextureKind::plain:
      break;
  }
  return 0;
}

double Plate::height(double x_mm, double y_mm) const {
  if (map_) return map_->height(x_mm, y_mm);
  double z = 0;  // textures do not overlap, so at most one term differs from 0
  for (const Band& band : bands_) z += band.height(x_mm, y_mm);
  return z;
}

std::vector<double> Plate::crests() const {
  if (map_) return map_->crests();
  std::vector<double> crests;
  for (const Band& band : bands_)
    for (int i = 0; i < band.count_y; ++i) crests.push_back(band.first_y + i * band.texture.pitch_mm);
  std::sort(crests.begin(), crests.end());
  return crests;
}

bool Plate::uniform_in_x() const {
  if (map_) return map_->uniform_in_x();
  return std::none_of(bands_.begin(), bands_.end(),
                      [](const Band& b) { return b.texture.kind == TextureKind::blobs; });
}

const std::vector<std::string>& rig_plates() {
  static const std::vector<std::string> kNames = {"3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges",
                                                  "4_Waves", "6_Waves", "4_Blob",   "6_Blob"};
  return kNames;
}

const std::vector<std::string>& default_plates() {
  static const std::vector<std::string> kNames = {"bumps12",  "bumps6",  "bumps4",
                                                  "ridges12", "ridges6", "ridges4"};
  return kNames;
}

}  // namespace supertac
