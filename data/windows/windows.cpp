#include "data/windows/windows.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <set>
#include <stdexcept>
#include <utility>

#include "data/plates/plate.h"
#include "data/plates/stl.h"
#include "data/plates/truth.h"
#include "data/windows/transforms.h"
#include "io/numbers/hash.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

void check(const WindowSettings& s) {
  const auto require = [](bool holds, const char* argument, const char* expected, double found) {
    if (!holds) throw std::invalid_argument(refusal("windows", argument, expected, format(found)));
  };
  s.array.value_or(TaxelArray{}).check();
  require(s.timesteps >= 1, "timesteps", "1 or more", s.timesteps);
  require(s.scale == 2 || s.scale == 4 || s.scale == 8 || s.scale == 16, "scale", "2, 4, 8 or 16", s.scale);
  require(s.stride >= 1, "stride", "1 or more", s.stride);
  require(s.rate_hz > 0, "rate_hz", "more than 0", s.rate_hz);
  require(std::abs(s.scaling.span) > 0, "scaling.span", "a number other than 0", s.scaling.span);
  require(s.delay_s >= 0 && std::lround(s.delay_s * s.rate_hz) < s.timesteps, "delay_s",
          "0 to less than the window lasts", s.delay_s);
}

// Each frame gets the place and the truth of an earlier one. Of the first few there is none; they end no
// window, since a window is longer than its delay.
void delay_truth(Track& track, std::size_t frames) {
  const auto shift = [&](auto& values, std::size_t each) {
    std::shift_right(values.begin(), values.end(), static_cast<std::ptrdiff_t>(each * frames));
  };
  shift(track.position_mm, 2), shift(track.lift_mm, 1), shift(track.recorded, 1);
}

// Pressed as deep as rigs press it, it is clear of the plate when lifted by so much more than the highest
// element.
constexpr double kClearanceMm = 1.5;
constexpr std::size_t kFingerNumbers = 3;  // x, y, lift

}  // namespace

std::string WindowCounts::summary() const {
  const auto part = [](std::size_t count, const char* what) {
    return count > 0 ? ", " + std::to_string(count) + " " + what : std::string();
  };
  return std::to_string(windows) + " windows from " + std::to_string(frames) + " samples of " +
         std::to_string(recordings) + " recordings" +
         (added > 0 ? " and " + std::to_string(added) + " simulated passes" : "") +
         part(unreliable, "in passes with unreliable registration") + part(no_position, "without position") +
         part(lifting, "while the finger was lifted or lowered") +
         part(too_early, "too close to the start of a pass or to a gap") +
         part(off_stride, "between strides") +
         (held > 0 ? "; " + std::to_string(held) + " samples without a frame repeat the one before" : "") +
         part(gaps, "gaps");
}

WindowSet WindowSet::load(const std::string& dir, const std::vector<std::string>& plates,
                          const WindowSettings& settings, const ReadingWatch& watch) {
  WindowSet set(settings);
  std::set<std::string> missing(plates.begin(), plates.end()), found;
  const std::vector<std::string> paths = list_recordings(dir);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (watch) watch(i, paths.size());
    const Recording recording = read_recording(paths[i]);
    found.insert(recording.plate);
    missing.erase(recording.plate);
    if (!plates.empty() && std::ranges::find(plates, recording.plate) == plates.end()) continue;
    try {
      set.add(recording, dir);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      throw std::runtime_error(paths[i] + ": " + error.what());
    }
  }
  if (!missing.empty())
    throw std::invalid_argument("windows: plate '" + *missing.begin() + "' has no recording in " + dir +
                                "; it has those of " + joined(found, ", "));
  if (set.size() == 0) throw std::runtime_error(dir + ": " + set.why_empty());
  return set;
}

// Where its frames went, and what helps.
std::string WindowSet::why_empty() const {
  const std::pair<std::size_t, const char*> reasons[] = {
      {counts_.unreliable, "import the passes again with their right plate and --speed"},
      {counts_.no_position,
       "truth needs positions or a tensor 'truth': import or collect passes over a known plate"},
      {counts_.lifting, "give passes in which the finger slides"},
      {counts_.too_early, "try fewer timesteps or longer passes"},
      {counts_.off_stride, "try a smaller stride"}};
  const auto [most, help] = *std::ranges::max_element(reasons, {}, [](const auto& r) { return r.first; });
  return "no window of " + std::to_string(settings_.timesteps) + " frames: " + counts_.summary() + "; " +
         (most > 0 ? help : "give recordings that hold frames");
}

WindowSet::WindowSet(const WindowSettings& settings)
    : settings_((check(settings), settings)), file_(std::make_shared<ScratchFile>()) {}

std::size_t WindowSet::plate_index(const Recording& recording, const std::string& folder) {
  const bool measured = !recording.truth.empty();
  for (std::size_t i = 0; i < plates_.size(); ++i)
    if (plates_[i].plate.name() == recording.plate && plates_[i].measured == measured) return i;
  plates_.push_back(
      {measured ? Plate(recording.plate, std::vector<Texture>{}) : plate_in_folder(recording.plate, folder),
       measured});
  return plates_.size() - 1;
}

void WindowSet::expect_array(const Recording& recording) {
  if (!settings_.array) settings_.array = recording.array;
  if (!settings_.body) settings_.body = recording.body.value_or(Body::usual(recording.array));
  if (recording.array != array())
    throw std::runtime_error("was recorded with " + recording.array.text() + ", expected " + array().text() +
                             "; give recordings of the array the model is for, and no others");
  const ImageGrid expected = image();
  if (!recording.truth.empty() &&
      (recording.truth_height != expected.height || recording.truth_width != expected.width))
    throw std::runtime_error("has a truth of " + std::to_string(recording.truth_height) + "x" +
                             std::to_string(recording.truth_width) + " pixels, expected " + expected.text() +
                             " for " + array().text() + " at scale " + std::to_string(scale()));
}

void WindowSet::expect_unit(const SignalScale& found) {
  if (!settings_.signal_scale) settings_.signal_scale = found;
  const SignalScale expected = signal_scale();
  if (found.unit == expected.unit && found.rises() == expected.rises()) return;
  const auto text = [](const SignalScale& s) {
    return in_quotes(s.unit) + (s.rises() ? " that rise" : " that fall") + " under pressure";
  };
  throw std::runtime_error("has signals in " + text(found) + ", expected " + text(expected) +
                           ", as in the others; give recordings of one sensor");
}

void WindowSet::add(const Recording& recording, const std::string& folder, const PassUse& use) {
  expect_array(recording);
  expect_unit(recording.signal_scale);
  Stored stored{.plate = plate_index(recording, folder)};
  Track track = resample(
      recording,
      {.rate_hz = settings_.rate_hz, .frames_apart = settings_.timesteps == 1, .scaling = settings_.scaling});
  delay_truth(track, delay_frames());
  Pass pass{.plate = recording.plate,
            .trial = recording.trial,
            .pass = recording.pass,
            .speed_mm_s = recording.speed_mm_s,
            .source = recording.source,
            .group = value_or(recording.metadata, "group"),
            .filter_s = recording.filter_s(),
            .frames = track.frames(),
            .first_window = size(),
            .windows = 0,
            .use = use};
  const auto stride = static_cast<std::uint32_t>(use.stride > 0 ? use.stride : settings_.stride);
  const bool measured = !recording.truth.empty(),
             reliable = value_or(recording.metadata, "registration_reliable") != "no";
  const double clear_mm = plates_[stored.plate].plate.max_height() + kClearanceMm;
  // Why a frame can end no window: the count it adds to; null when it can.
  const auto why_none = [&](std::size_t frame) -> std::size_t WindowCounts::* {
    if (measured) return nullptr;
    if (!reliable) return &WindowCounts::unreliable;
    if (!std::isfinite(track.position_mm[2 * frame]) || !std::isfinite(track.position_mm[2 * frame + 1]))
      return &WindowCounts::no_position;
    const float lift = track.lift_mm[frame];
    return lift > kLiftedMm && lift < clear_mm ? &WindowCounts::lifting : nullptr;
  };
  for (std::size_t first = 0, end = 0; first < track.frames(); first = end) {
    const auto why = why_none(first);
    for (end = first + 1; end < track.frames() && track.run[end] > 1 && why_none(end) == why;) ++end;
    if (why != nullptr)
      counts_.*why += end - first;
    else
      add_windows(track, first, end, stride);
  }
  pass.windows = size() - pass.first_window;
  if (pass.windows > 0) store(recording, track, stored);
  ++(use.augmentable ? counts_.recordings : counts_.added);
  counts_.frames += track.frames();
  counts_.held += track.held;
  if (settings_.timesteps > 1) counts_.gaps += track.gaps;
  passes_.push_back(std::move(pass));
  stored_.push_back(stored);
}

// The windows that end in [first, end), and why its other frames end none.
void WindowSet::add_windows(const Track& track, std::size_t first, std::size_t end, std::uint32_t stride) {
  const auto timesteps = static_cast<std::size_t>(settings_.timesteps);
  const std::size_t early = track.run[first] < timesteps ? timesteps - track.run[first] : 0;
  const std::size_t begin = std::min(first + early, end);
  const std::size_t last = (begin + stride - 1) / stride * stride;
  const std::size_t windows = last < end ? (end - last + stride - 1) / stride : 0;
  counts_.too_early += begin - first;
  counts_.off_stride += end - begin - windows;
  if (windows == 0) return;
  rows_.push_back({static_cast<std::uint32_t>(passes_.size()), static_cast<std::uint32_t>(last),
                   track.run[last], stride, counts_.windows});
  counts_.windows += windows;
}

void WindowSet::store(const Recording& recording, const Track& track, Stored& stored) {
  std::vector<float> fingers;
  for (std::size_t i = 0; i < track.frames(); ++i)
    fingers.insert(fingers.end(), {track.position_mm[2 * i], track.position_mm[2 * i + 1], track.lift_mm[i]});
  stored.samples = file_->append(track.samples);
  stored.fingers = file_->append(fingers);
  if (recording.truth.empty()) return;
  const std::size_t pixels = image().pixels();
  std::vector<float> truths;
  for (const std::uint32_t frame : track.recorded) {
    const auto truth = std::span(recording.truth).subspan(frame * pixels, pixels);
    truths.insert(truths.end(), truth.begin(), truth.end());
  }
  stored.truths = file_->append(truths);
  contact_levels_.push_back(supertac::contact_level(recording.truth, pixels));
}

WindowSet::Place WindowSet::place_of(std::size_t i) const {
  const Row& row = *std::prev(std::ranges::upper_bound(rows_, i, {}, &Row::first_window));
  const std::size_t further = (i - row.first_window) * row.stride;
  return {row.pass, row.last + further, row.run + further};
}

// Its (x, y, lift) at the end of a window.
std::array<float, 3> WindowSet::finger(const Place& place) const {
  std::array<float, kFingerNumbers> finger;
  file_->read(stored_[place.pass].fingers + place.last * kFingerNumbers, finger);
  return finger;
}

// From so many frames before the last one of a window on.
void WindowSet::read_samples(std::size_t i, std::size_t frames_back, std::span<float> out) const {
  const Place place = place_of(i);
  file_->read(stored_[place.pass].samples + (place.last - frames_back) * array().signals(), out);
}

void WindowSet::window(std::size_t i, std::span<float> out) const {
  expect_values("windows", "window", input_size(), out.size());
  read_samples(i, frames() - 1, out);
  if (settings_.scaling.per_window) normalise_window(out, array().signals());
}

std::vector<float> WindowSet::raw_window(std::size_t i) const {
  std::vector<float> values(input_size());
  read_samples(i, frames() - 1, values);
  return values;
}

std::vector<float> WindowSet::shown_frame(std::size_t i) const {
  std::vector<float> values(array().signals());
  read_samples(i, delay_frames(), values);
  return values;
}

WindowSet::Position WindowSet::position(std::size_t i) const {
  const auto [x, y, lift] = finger(place_of(i));
  return {x, y};
}

std::string WindowSet::place_text(std::size_t i) const {
  const auto [x, y] = position(i);
  if (!std::isfinite(x) || !std::isfinite(y)) return "frame " + std::to_string(frame_of(i));
  return "x " + format(x, 1) + ", y " + format(y, 1) + " mm";
}

void WindowSet::truth(std::size_t i, std::span<float> out) const {
  expect_values("windows", "truth", image().pixels(), out.size());
  const Place place = place_of(i);
  if (truth_is_measured(place.pass))
    return file_->read(stored_[place.pass].truths + place.last * out.size(), out);
  const auto [x, y, lift] = finger(place);
  // A finger that is lifted halfway ends no window (why_none()); here it is clear of the plate, in the air.
  if (lift > kLiftedMm) return std::fill(out.begin(), out.end(), 0.0F);
  truth_image(plate(place.pass), x, y, image(), out);
}

Zone WindowSet::zone(std::size_t i) const {
  const Place place = place_of(i);
  if (truth_is_measured(place.pass)) {
    std::vector<float> pixels(image().pixels());
    truth(i, pixels);
    return in_contact(pixels, *contact_level()) ? Zone::contact : Zone::flat;
  }
  const auto [x, y, lift] = finger(place);
  return lift > kLiftedMm ? Zone::air : zone_of(plate(place.pass), x, y, image());
}

std::optional<float> WindowSet::contact_level() const {
  if (contact_levels_.empty()) return std::nullopt;
  return settings_.contact_level ? settings_.contact_level : median(std::vector(contact_levels_));
}

std::optional<double> WindowSet::filter_s() const {
  std::optional<double> common;
  for (const Pass& pass : passes_) {
    if (pass.windows == 0 || !pass.use.in_distribution) continue;  // silence has gone through no filter
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
  for (const auto& [plate, measured] : plates_) {
    if (measured || !Plate::is_file(plate.name())) continue;  // elsewhere the name is the plate
    for (double y = 0; y <= rig::kPlateLengthMm; y += HeightMap::kCellMm)
      for (double x = 0; x <= rig::kPlateWidthMm; x += HeightMap::kCellMm)
        hash.add(static_cast<float>(plate.height(x, y)));
  }
  for (std::size_t p = 0; p < passes_.size(); ++p) {
    hash.add(passes_[p].plate);
    hash.add(passes_[p].trial);
    if (passes_[p].windows == 0) continue;
    std::vector<float> samples(passes_[p].frames * array().signals()),
        fingers(passes_[p].frames * kFingerNumbers), truth(image().pixels());
    file_->read(stored_[p].samples, samples);
    file_->read(stored_[p].fingers, fingers);
    for (const float v : samples) hash.add(v);
    for (std::size_t i = 0; i < fingers.size(); i += kFingerNumbers)
      hash.add(fingers[i]), hash.add(fingers[i + 1]);
    for (std::size_t i = 2; i < fingers.size(); i += kFingerNumbers) hash.add(fingers[i]);
    for (std::size_t i = 0; truth_is_measured(p) && i < passes_[p].frames; ++i) {
      file_->read(stored_[p].truths + i * truth.size(), truth);
      for (const float v : truth) hash.add(v);
    }
  }
  for (std::size_t i = 0; i < size(); ++i) {
    const Place place = place_of(i);
    hash.add((std::uint64_t{place.pass} << 32) | place.last);
  }
  return hash.hex();
}

}  // namespace supertac
