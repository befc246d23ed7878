#include "data/samples/windows.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <stdexcept>

#include "data/plates/height_map.h"
#include "data/plates/plate_file.h"
#include "data/plates/truth.h"
#include "data/samples/levelling.h"
#include "io/hash.h"

namespace supertac {
namespace {

// A finger that is pressed as deep as rigs press it is clear of the plate when it is lifted by so much more
// than the highest element.
constexpr double kClearanceMm = 1.5;
// A height that is measured is never quite that of the slide.
constexpr double kLiftedMm = 0.1;

void check(const WindowSettings& s) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("windows: " + what); };
  if (s.timesteps < 1) fail("timesteps must be at least 1, got " + std::to_string(s.timesteps));
  if (s.scale != 2 && s.scale != 4 && s.scale != 8)
    fail("scale must be 2, 4 or 8, got " + std::to_string(s.scale));
  if (s.stride < 1) fail("stride must be at least 1, got " + std::to_string(s.stride));
  if (!(s.rate_hz > 0) || !(s.max_gap_s > 0) || !(s.scaling.span_volts > 0))
    fail("rate_hz, max_gap_s and span_volts must be positive, got " + std::to_string(s.rate_hz) + ", " +
         std::to_string(s.max_gap_s) + " and " + std::to_string(s.scaling.span_volts));
}

void check_size(const char* what, std::size_t got, std::size_t expected) {
  if (got != expected)
    throw std::invalid_argument("windows: " + std::string(what) + " needs room for " +
                                std::to_string(expected) + " values, got " + std::to_string(got));
}

bool is_reliable(const Recording& recording) {
  const auto flag = recording.metadata.find("registration_reliable");
  return flag == recording.metadata.end() || flag->second != "no";
}

}  // namespace

std::string WindowCounts::summary() const {
  const auto part = [](std::size_t count, const char* what) {
    return count > 0 ? ", " + std::to_string(count) + " " + what : std::string();
  };
  return std::to_string(windows) + " windows from " + std::to_string(frames) + " frames of " +
         std::to_string(recordings) + " recordings" +
         part(unreliable, "in passes with unreliable registration") + part(no_position, "without position") +
         part(lifting, "while the finger was lifted or lowered") +
         part(too_early, "too close to the start of a pass or to a gap") +
         part(off_stride, "between strides") + part(held, "held for lack of a sample") + part(gaps, "gaps") +
         part(damaged, "damaged");
}

WindowSet WindowSet::load(const std::string& dir, const std::vector<std::string>& plates,
                          const WindowSettings& settings) {
  WindowSet set(settings);
  set.add_directory(dir, plates);
  if (set.size() == 0)
    throw std::runtime_error(dir + ": no window of " + std::to_string(settings.timesteps) +
                             " frames: " + set.counts_.summary() + "; try fewer timesteps or longer passes");
  return set;
}

void WindowSet::add_directory(const std::string& dir, const std::vector<std::string>& plates, bool aside) {
  std::set<std::string> missing(plates.begin(), plates.end()), found;
  for (const std::string& path : list_recordings(dir)) {
    const Recording recording = read_recording(path);
    found.insert(recording.plate);
    if (!plates.empty() && std::find(plates.begin(), plates.end(), recording.plate) == plates.end()) continue;
    missing.erase(recording.plate);
    try {
      add(recording, dir, aside);
    } catch (const std::exception& error) {
      throw std::runtime_error(path + ": " + error.what());
    }
  }
  if (missing.empty()) return;
  std::string names;
  for (const std::string& name : found) names += (names.empty() ? "" : ", ") + name;
  throw std::invalid_argument("windows: plate '" + *missing.begin() + "' has no recording in " + dir +
                              "; it has those of " + names);
}

WindowSet::WindowSet(const WindowSettings& settings) : settings_(settings) {
  check(settings);
  array().check();
}

std::size_t WindowSet::plate_index(const std::string& name, const std::string& folder) {
  for (std::size_t i = 0; i < plates_.size(); ++i)
    if (plates_[i].name() == name) return i;
  plates_.push_back(plate_in_folder(name, folder));
  return plates_.size() - 1;
}

// Whether a window may end at this frame; counts the reason if not.
bool WindowSet::accept(const Track& track, std::size_t frame, bool reliable, double clear_mm, int stride) {
  const float x = track.position_mm[2 * frame], y = track.position_mm[2 * frame + 1];
  const float lift = track.lift_mm[frame];
  std::size_t* reason = nullptr;
  if (!reliable)
    reason = &counts_.unreliable;
  else if (!std::isfinite(x) || !std::isfinite(y))
    reason = &counts_.no_position;
  else if (lift > kLiftedMm && lift < clear_mm)
    reason = &counts_.lifting;
  else if (track.run[frame] < static_cast<std::uint32_t>(settings_.timesteps))
    reason = &counts_.too_early;
  else if (frame % static_cast<std::size_t>(stride) != 0)
    reason = &counts_.off_stride;
  else
    reason = &counts_.windows;
  ++*reason;
  return reason == &counts_.windows;
}

void WindowSet::add(const Recording& recording, const std::string& folder, bool aside) {
  append(recording, folder, {.aside = aside, .varied = true, .stride = settings_.stride});
}

void WindowSet::add_one_of_many(const Recording& recording, int stride) {
  append(recording, ".", {.aside = true, .varied = false, .stride = stride});
}

void WindowSet::append(const Recording& recording, const std::string& folder, const Use& use) {
  if (!settings_.array) settings_.array = recording.array;
  if (recording.array != array())
    throw std::runtime_error("was recorded with " + recording.array.text() + ", expected " + array().text() +
                             "; give recordings of the array the model is for, and no others");
  const std::size_t plate = plate_index(recording.plate, folder);
  Track track = resample(
      recording,
      {.rate_hz = settings_.rate_hz, .max_gap_s = settings_.max_gap_s, .scaling = settings_.scaling});
  const bool reliable = is_reliable(recording);
  Pass pass{.plate = recording.plate,
            .trial = recording.trial,
            .pass = recording.pass,
            .speed_mm_s = recording.speed_mm_s,
            .source = recording.source,
            .filter_s = recording.filter_s(),
            .frames = track.frames(),
            .first_window = index_.size(),
            .windows = 0,
            .aside = use.aside,
            .varied = use.varied};
  const auto number = static_cast<std::uint32_t>(passes_.size());
  const double clear_mm = plates_[plate].max_height() + kClearanceMm;
  for (std::size_t frame = 0; frame < track.frames(); ++frame)
    if (accept(track, frame, reliable, clear_mm, use.stride))
      index_.push_back({number, static_cast<std::uint32_t>(frame)});
  pass.windows = index_.size() - pass.first_window;
  ++counts_.recordings;
  counts_.frames += track.frames();
  counts_.held += track.held;
  counts_.gaps += track.gaps;
  counts_.damaged += track.damaged;
  track.samples.shrink_to_fit();
  track.position_mm.shrink_to_fit();
  track.lift_mm.shrink_to_fit();
  if (pass.windows == 0) track = {};  // nothing will read it
  passes_.push_back(std::move(pass));
  tracks_.push_back(std::move(track));
  plate_of_.push_back(plate);
}

std::span<const float> WindowSet::window(std::size_t i) const {
  const auto [pass, last] = index_[i];
  const auto frames = static_cast<std::size_t>(settings_.timesteps);
  const std::size_t signals = settings_.array->signals();  // there is a window, so there was a recording
  return std::span(tracks_[pass].samples).subspan((last + 1 - frames) * signals, frames * signals);
}

void WindowSet::window(std::size_t i, std::span<float> out) const {
  const std::span<const float> source = window(i);
  check_size("a window", out.size(), source.size());
  std::memcpy(out.data(), source.data(), source.size_bytes());
  if (settings_.scaling.levelled) level(out, array().signals());
}

std::span<const float> WindowSet::last_frame(std::size_t i) const {
  return window(i).last(array().signals());
}

WindowSet::Position WindowSet::position(std::size_t i) const {
  const auto [pass, last] = index_[i];
  const std::vector<float>& position = tracks_[pass].position_mm;
  return {position[2 * std::size_t{last}], position[2 * std::size_t{last} + 1]};
}

void WindowSet::truth(std::size_t i, std::span<float> out) const {
  check_size("a truth image", out.size(), image().pixels());
  if (in_air(i)) return std::fill(out.begin(), out.end(), 0.0F);
  const auto [x, y] = position(i);
  truth_image(plates_[plate_of_[index_[i].pass]], x, y, image(), out);
}

// While it is lifted there are no windows.
bool WindowSet::in_air(std::size_t i) const {
  return tracks_[index_[i].pass].lift_mm[index_[i].last] > kLiftedMm;
}

Zone WindowSet::zone(std::size_t i) const {
  const auto [x, y] = position(i);
  return in_air(i) ? Zone::air : zone_of(plates_[plate_of_[index_[i].pass]], x, y, image());
}

std::optional<double> WindowSet::filter_s() const {
  std::optional<double> common;
  for (const Pass& pass : passes_) {
    if (pass.windows == 0) continue;
    if (common && *common != pass.filter_s) return std::nullopt;
    common = pass.filter_s;
  }
  return common;
}

std::string WindowSet::fingerprint() const {
  Hash hash;
  hash.add(settings_.timesteps);
  hash.add(settings_.scale);
  if (array() != TaxelArray{}) hash.add(array().text());
  for (const Plate& plate : plates_) {
    if (!Plate::is_file(plate.name())) continue;  // elsewhere the name is the plate
    for (double y = 0; y <= Plate::kLengthMm; y += HeightMap::kCellMm)
      for (double x = 0; x <= Plate::kWidthMm; x += HeightMap::kCellMm)
        hash.add(static_cast<float>(plate.height(x, y)));
  }
  for (std::size_t p = 0; p < passes_.size(); ++p) {
    hash.add(passes_[p].plate);
    hash.add(passes_[p].trial);
    for (const float v : tracks_[p].samples) hash.add(v);
    for (const float v : tracks_[p].position_mm) hash.add(v);
    for (const float v : tracks_[p].lift_mm) hash.add(v);
  }
  for (const Entry& entry : index_) hash.add((std::uint64_t{entry.pass} << 32) | entry.last);
  return hash.hex();
}

}  // namespace supertac
