#include "data/windows/windows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "data/plates/height_map.h"
#include "data/plates/plate_file.h"
#include "data/plates/truth.h"
#include "data/windows/chosen_plates.h"
#include "data/windows/levelling.h"
#include "io/numbers/hash.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

void check(const WindowSettings& s) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("windows: " + what); };
  if (s.timesteps < 1) fail("timesteps must be at least 1, got " + std::to_string(s.timesteps));
  if (s.scale != 2 && s.scale != 4 && s.scale != 8)
    fail("scale must be 2, 4 or 8, got " + std::to_string(s.scale));
  if (s.stride < 1) fail("stride must be at least 1, got " + std::to_string(s.stride));
  if (!(s.rate_hz > 0) || !(s.max_gap_s > 0) || !(std::abs(s.scaling.span_volts) > 0))
    fail("rate_hz and max_gap_s must be positive, span_volts not 0, got " + std::to_string(s.rate_hz) + ", " +
         std::to_string(s.max_gap_s) + " and " + std::to_string(s.scaling.span_volts));
}

void check_size(const char* what, std::size_t got, std::size_t expected) {
  if (got != expected)
    throw std::invalid_argument("windows: " + std::string(what) + " needs room for " +
                                std::to_string(expected) + " values, got " + std::to_string(got));
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
                          const WindowSettings& settings, const ReadingWatch& watch) {
  WindowSet set(settings);
  set.add_directory(dir, plates, false, watch);
  set.check_any(dir);
  return set;
}

void WindowSet::check_any(const std::string& dir) const {
  if (size() > 0) return;
  throw std::runtime_error(dir + ": no window of " + std::to_string(settings_.timesteps) +
                           " frames: " + counts_.summary() + "; try fewer timesteps or longer passes");
}

void WindowSet::add_directory(const std::string& dir, const std::vector<std::string>& plates, bool aside,
                              const ReadingWatch& watch) {
  ChosenPlates chosen(plates);
  const std::vector<std::string> paths = list_recordings(dir);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (watch) watch(i, paths.size());
    const Recording recording = read_recording(paths[i]);
    if (!chosen.take(recording.plate)) continue;
    try {
      add(recording, dir, aside);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      throw std::runtime_error(paths[i] + ": " + error.what());
    }
  }
  chosen.check(dir);
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

void WindowSet::add(const Recording& recording, const std::string& folder, bool aside) {
  append(recording, folder, {.aside = aside, .varied = true, .stride = settings_.stride});
}

void WindowSet::add_one_of_many(const Recording& recording, int stride, bool usual) {
  append(recording, ".", {.aside = true, .varied = false, .stride = stride, .usual = usual});
}

void WindowSet::expect_array(const TaxelArray& found) {
  if (!settings_.array) settings_.array = found;
  if (found != array())
    throw std::runtime_error("was recorded with " + found.text() + ", expected " + array().text() +
                             "; give recordings of the array the model is for, and no others");
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

void WindowSet::append(const Recording& recording, const std::string& folder, const Use& use) {
  expect_array(recording.array);
  expect_unit(recording.signal_scale);
  const std::size_t plate = plate_index(recording.plate, folder);
  Track track = resample(
      recording,
      {.rate_hz = settings_.rate_hz, .max_gap_s = settings_.max_gap_s, .scaling = settings_.scaling});
  append(card_of(recording, track, plates_[plate]), plate, use);
  track.run = {};
  track.samples.shrink_to_fit();
  track.position_mm.shrink_to_fit();
  track.lift_mm.shrink_to_fit();
  if (passes_.back().windows == 0) track = {};  // nothing will read it
  sources_.push_back({std::move(track), nullptr, 0});
}

void WindowSet::add(std::shared_ptr<const TrackFile> file, bool aside) {
  expect_array(file->index().array);
  const std::vector<TrackCard>& cards = file->index().cards;
  for (std::size_t i = 0; i < cards.size(); ++i) {
    append(cards[i], plate_index(cards[i].plate, file->folder()),
           {.aside = aside, .varied = true, .stride = settings_.stride});
    sources_.push_back({{}, file, i});
  }
}

void WindowSet::append(const TrackCard& card, std::size_t plate, const Use& use) {
  Pass pass{.plate = card.plate,
            .trial = card.trial,
            .pass = card.pass,
            .speed_mm_s = card.speed_mm_s,
            .source = card.source,
            .filter_s = card.filter_s,
            .frames = card.frames,
            .first_window = size(),
            .windows = 0,
            .aside = use.aside,
            .varied = use.varied,
            .usual = use.usual};
  for (const FrameRange& stretch : card.stretches)
    append(card, stretch, static_cast<std::uint32_t>(use.stride));
  pass.windows = size() - pass.first_window;
  ++counts_.recordings;
  counts_.frames += card.frames;
  counts_.held += card.held;
  counts_.gaps += card.gaps;
  counts_.damaged += card.damaged;
  passes_.push_back(std::move(pass));
  plate_of_.push_back(plate);
}

// The windows that end in the stretch, and why its other frames end none.
void WindowSet::append(const TrackCard& card, const FrameRange& stretch, std::uint32_t stride) {
  if (!card.reliable) {
    counts_.unreliable += stretch.frames;
  } else if (stretch.kind != FrameRange::usable) {
    (stretch.kind == FrameRange::lifting ? counts_.lifting : counts_.no_position) += stretch.frames;
  } else {
    const auto timesteps = static_cast<std::uint32_t>(settings_.timesteps);
    const std::uint32_t early = stretch.run < timesteps ? timesteps - stretch.run : 0;
    const std::uint32_t skipped = std::min(early, stretch.frames);
    const std::uint32_t begin = stretch.first + skipped, end = stretch.first + stretch.frames;
    const std::uint32_t last = (begin + stride - 1) / stride * stride;
    const std::uint32_t windows = last < end ? (end - last + stride - 1) / stride : 0;
    counts_.too_early += skipped;
    counts_.off_stride += end - begin - windows;
    if (windows == 0) return;
    rows_.push_back({static_cast<std::uint32_t>(passes_.size()), last, stretch.run + last - stretch.first,
                     stride, counts_.windows});
    counts_.windows += windows;
  }
}

WindowSet::Place WindowSet::place_of(std::size_t i) const {
  const Row& row = *std::prev(std::ranges::upper_bound(rows_, i, {}, &Row::first_window));
  const std::size_t further = (i - row.first_window) * row.stride;
  return {row.pass, row.last + further, row.run + further};
}

void WindowSet::samples(std::size_t pass, std::size_t first, std::span<float> out) const {
  const Source& source = sources_[pass];
  if (source.file) {
    source.file->volts(source.card, first, out);
    settings_.scaling(out);
  } else {
    std::copy_n(&source.track.samples[first * array().signals()], out.size(), out.begin());
  }
}

// Its (x, y, lift) at the end of a window.
std::array<float, 3> WindowSet::finger(const Place& place) const {
  const Source& source = sources_[place.pass];
  if (source.file) return source.file->place(source.card, place.last);
  const Track& track = source.track;
  return {track.position_mm[2 * place.last], track.position_mm[2 * place.last + 1],
          track.lift_mm[place.last]};
}

Track WindowSet::track(std::size_t pass) const {
  const Source& source = sources_[pass];
  if (!source.file || passes_[pass].windows == 0) return source.track;
  Track track = source.file->track(source.card);
  settings_.scaling(track.samples);
  return track;
}

void WindowSet::window(std::size_t i, std::span<float> out) const {
  const std::size_t values = frames() * array().signals();
  check_size("a window", out.size(), values);
  const Place place = place_of(i);
  samples(place.pass, place.last + 1 - frames(), out);
  if (settings_.scaling.levelled) level(out, array().signals());
}

void WindowSet::will_read(std::size_t i) const {
  const Place place = place_of(i);
  const Source& source = sources_[place.pass];
  if (source.file) source.file->will_read(source.card, place.last + 1 - frames(), frames());
}

std::vector<float> WindowSet::window(std::size_t i) const {
  std::vector<float> values(frames() * array().signals());
  const Place place = place_of(i);
  samples(place.pass, place.last + 1 - frames(), values);
  return values;
}

std::vector<float> WindowSet::last_frame(std::size_t i) const {
  std::vector<float> values(array().signals());
  const Place place = place_of(i);
  samples(place.pass, place.last, values);
  return values;
}

WindowSet::Position WindowSet::position(std::size_t i) const {
  const auto [x, y, lift] = finger(place_of(i));
  return {x, y};
}

void WindowSet::truth(std::size_t i, std::span<float> out) const {
  check_size("a truth image", out.size(), image().pixels());
  const Place place = place_of(i);
  const auto [x, y, lift] = finger(place);
  // While it is lifted there are no windows.
  if (lift > kLiftedMm) return std::fill(out.begin(), out.end(), 0.0F);
  truth_image(plate(place.pass), x, y, image(), out);
}

Zone WindowSet::zone(std::size_t i) const {
  const Place place = place_of(i);
  const auto [x, y, lift] = finger(place);
  return lift > kLiftedMm ? Zone::air : zone_of(plate(place.pass), x, y, image());
}

std::optional<std::string> WindowSet::content(const std::string& folder) const {
  for (const Source& source : sources_)
    if (source.file && source.file->folder() == folder) return source.file->index().content;
  return std::nullopt;
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

std::string WindowSet::recall(const std::string& key, const std::function<std::string()>& compute) const {
  const std::shared_ptr<const TrackFile> file = sources_.empty() ? nullptr : sources_.front().file;
  const bool one = file && passes_.size() == file->index().cards.size() &&
                   std::ranges::all_of(sources_, [&](const Source& s) { return s.file == file; });
  if (!one) return compute();
  Hash settings;
  for (const int number : {settings_.timesteps, settings_.scale, settings_.stride}) settings.add(number);
  for (const double volts : {settings_.scaling.rest_volts, settings_.scaling.span_volts})
    settings.add(std::bit_cast<std::uint64_t>(volts));
  return file->recall(key + " " + settings.hex(), compute);
}

std::string WindowSet::fingerprint() const {
  return recall("fingerprint", [this] { return compute_fingerprint(); });
}

std::string WindowSet::compute_fingerprint() const {
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
    const Track all = track(p);
    for (const auto* values : {&all.samples, &all.position_mm, &all.lift_mm})
      for (const float v : *values) hash.add(v);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const std::size_t end = r + 1 < rows_.size() ? rows_[r + 1].first_window : size();
    for (std::size_t i = rows_[r].first_window; i < end; ++i)
      hash.add((std::uint64_t{rows_[r].pass} << 32) |
               (rows_[r].last + (i - rows_[r].first_window) * rows_[r].stride));
  }
  return hash.hex();
}

}  // namespace supertac
