#include "data/samples/windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <stdexcept>

#include "data/plates/plate_file.h"
#include "data/plates/truth.h"
#include "data/samples/levelling.h"
#include "io/hash.h"

namespace supertac {
namespace {

constexpr std::size_t kLargestImage = std::size_t{16 * 8} * std::size_t{16 * 8};

void check(const WindowSettings& s) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("windows: " + what); };
  if (s.timesteps < 1) fail("timesteps must be at least 1, got " + std::to_string(s.timesteps));
  if (s.scale != 2 && s.scale != 4 && s.scale != 8)
    fail("scale must be 2, 4 or 8, got " + std::to_string(s.scale));
  if (s.stride < 1) fail("stride must be at least 1, got " + std::to_string(s.stride));
  if (!(s.rate_hz > 0) || !(s.max_gap_s > 0) || !(s.scaling.span_volts > 0))
    fail("rate_hz, max_gap_s and span_volts must be positive, got " + std::to_string(s.rate_hz) + ", " +
         std::to_string(s.max_gap_s) + " and " + std::to_string(s.scaling.span_volts));
  if (!(s.min_y_mm < s.max_y_mm))
    fail("min_y_mm must be below max_y_mm, got " + std::to_string(s.min_y_mm) + " and " +
         std::to_string(s.max_y_mm));
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
         part(outside, "outside the y range") +
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
  std::set<std::string> missing(plates.begin(), plates.end());
  for (const std::string& path : list_recordings(dir)) {
    const Recording recording = read_recording(path);
    if (!plates.empty() && std::find(plates.begin(), plates.end(), recording.plate) == plates.end()) continue;
    missing.erase(recording.plate);
    try {
      add(recording, dir, aside);
    } catch (const std::exception& error) {
      throw std::runtime_error(path + ": " + error.what());
    }
  }
  if (!missing.empty())
    throw std::invalid_argument("windows: plate '" + *missing.begin() + "' has no recording in " + dir);
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
bool WindowSet::accept(const Track& track, std::size_t frame, bool reliable) {
  const float x = track.position_mm[2 * frame], y = track.position_mm[2 * frame + 1];
  std::size_t* reason = nullptr;
  if (!reliable)
    reason = &counts_.unreliable;
  else if (!std::isfinite(x) || !std::isfinite(y))
    reason = &counts_.no_position;
  else if (y < settings_.min_y_mm || y > settings_.max_y_mm)
    reason = &counts_.outside;
  else if (track.run[frame] < static_cast<std::uint32_t>(settings_.timesteps))
    reason = &counts_.too_early;
  else if (frame % static_cast<std::size_t>(settings_.stride) != 0)
    reason = &counts_.off_stride;
  else
    reason = &counts_.windows;
  ++*reason;
  return reason == &counts_.windows;
}

void WindowSet::add(const Recording& recording, const std::string& folder, bool aside) {
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
            .aside = aside};
  const auto number = static_cast<std::uint32_t>(passes_.size());
  for (std::size_t frame = 0; frame < track.frames(); ++frame)
    if (accept(track, frame, reliable)) index_.push_back({number, static_cast<std::uint32_t>(frame)});
  pass.windows = index_.size() - pass.first_window;
  ++counts_.recordings;
  counts_.frames += track.frames();
  counts_.held += track.held;
  counts_.gaps += track.gaps;
  counts_.damaged += track.damaged;
  track.samples.shrink_to_fit();
  track.position_mm.shrink_to_fit();
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
  const auto [x, y] = position(i);
  truth_image(plates_[plate_of_[index_[i].pass]], x, y, image(), out);
}

bool WindowSet::contact(std::size_t i) const {
  std::array<float, kLargestImage> pixels;
  const std::span<float> image_of_it = std::span(pixels).first(image().pixels());
  truth(i, image_of_it);
  return in_contact(image_of_it);
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
  }
  for (const Entry& entry : index_) hash.add((std::uint64_t{entry.pass} << 32) | entry.last);
  return hash.hex();
}

}  // namespace supertac
