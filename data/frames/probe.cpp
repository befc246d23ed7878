#include "data/frames/probe.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numeric>
#include <span>

#include "data/frames/binary_columns.h"
#include "data/frames/binary_decoder.h"
#include "data/frames/sensor_decoder.h"
#include "data/frames/text_grammar.h"
#include "data/sensors/rest_tracker.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// The frames that were heard, [signal][frame]: as Sensor::arrange() without rest and gain; without those in
// which a signal is no number.
struct HeardFrames {
  std::vector<std::vector<float>> signals;
  std::size_t count = 0, steps = 0;
  double seconds = 0, frame_bytes = 0;  // of the steps in which time went on; of all whole frames
};

HeardFrames frames_of(const Sensor& sensor, std::span<const Heard> heard) {
  Sensor bare = sensor;
  bare.rest.clear(), bare.gain.clear();
  const auto decoder = make_decoder(sensor);
  HeardFrames frames;
  frames.signals.resize(sensor.array.signals());
  std::vector<float> signals(sensor.array.signals());
  double before = 0;
  for (const Heard& chunk : heard)
    decoder->push(std::as_bytes(std::span(chunk.bytes)), [&](const DecodedFrame& frame) {
      bare.arrange(frame.values, signals);
      if (!std::ranges::all_of(signals, [](float v) { return std::isfinite(v); })) return;
      const double time = frame.time_s.value_or(chunk.time_s);
      if (frames.count++ > 0 && time >= before) ++frames.steps, frames.seconds += time - before;
      before = time;
      for (std::size_t s = 0; s < signals.size(); ++s) frames.signals[s].push_back(signals[s]);
    });
  const auto counted = decoder->counters();
  frames.frame_bytes = static_cast<double>(counted.bytes - counted.discarded_bytes);
  return frames;
}

constexpr double kOddJump = 5;  // beside the largest of the others

// How many values at an end of a frame hold what is no signal, such as a checksum of a form that is not
// known, or 0: as a rule they jump from frame to frame farther than all others do, by several times, or are
// real numbers of quite another size. Numbers that no sensor measures (1e-40) are whole frames read amiss.
std::size_t odd_values(const HeardFrames& frames, const std::string& type) {
  const bool real = type == "f32";
  std::vector<double> jumps, sizes;
  for (const std::vector<float>& signal : frames.signals) {
    std::vector<double> steps, away;
    const double middle = median(std::vector(signal));
    if (real && middle != 0 && std::abs(middle) < 1e-30) return frames.signals.size();
    for (std::size_t i = 1; i < signal.size(); ++i)
      steps.push_back(std::abs(double{signal[i]} - double{signal[i - 1]})),
          away.push_back(std::abs(signal[i] - middle));
    const auto [low, high] = std::ranges::minmax(signal);
    jumps.push_back(std::min(median(steps), median(away)));
    sizes.push_back(std::max(std::abs(low), std::abs(high)));
  }
  for (int end = 0; end < 2; ++end) {
    std::ranges::reverse(jumps), std::ranges::reverse(sizes);
    for (std::size_t k = 1; k <= 4 / bytes_of(type) && 2 * k <= jumps.size(); ++k) {
      const double far = std::max(std::ranges::max(std::span(jumps).subspan(k)), real ? 0.0 : 1.0),
                   large = std::ranges::max(std::span(sizes).subspan(k));
      for (std::size_t i = 0; i < k; ++i)
        if (jumps[i] > kOddJump * far ||
            (real && jumps[i] > 0 && (sizes[i] > 1e4 * large || sizes[i] < 1e-6 * large)))
          return k;
    }
  }
  return 0;
}

// Polarity, range, noise and what never moves; into the draft where they are known.
// What was known of a sensor stays where nothing says more than that.
void look_at_signals(Sensor& draft, const HeardFrames& frames, const std::optional<Sensor>& known,
                     std::vector<std::string>& says) {
  std::vector<double> noises, above, below;  // of each signal's median
  std::vector<int> still;
  bool whole = true;
  const auto channels = static_cast<std::size_t>(draft.array.channels);
  for (std::size_t k = 0; k < frames.signals.size(); ++k) {
    std::vector<float> values = frames.signals[k];
    std::vector<double> steps;
    for (std::size_t i = 1; i < values.size(); ++i)
      steps.push_back(std::abs(double{values[i]} - double{values[i - 1]}));
    whole = whole && std::ranges::all_of(values, [](float v) { return v == std::round(v); });
    const auto [low, high] = std::ranges::minmax(values);
    if (low == high && k % channels == 0) still.push_back(static_cast<int>(k / channels));
    const float middle = median(values);
    noises.push_back(steps.empty() ? 0 : quantile(steps, 0.75));
    above.push_back(double{high} - double{middle}), below.push_back(double{middle} - double{low});
  }
  // A taxel may be pressed for most of the time: the array as a whole says which way pressing goes.
  const bool upwards = std::reduce(above.begin(), above.end()) >= std::reduce(below.begin(), below.end());
  const std::vector<double> rests = rests_between_touches(frames.signals, draft.array.channels, upwards);
  double strongest = 0;
  std::vector<double> moving, sorted = rests;
  for (std::size_t k = 0; k < rests.size(); ++k) {
    const auto [low, high] = std::ranges::minmax(frames.signals[k]);
    if (low < high) moving.push_back(rests[k]);
    strongest = std::max(strongest, upwards ? double{high} - rests[k] : rests[k] - double{low});
  }
  const double rest = median(sorted), noise = std::max(median(noises), whole ? 1.0 : 1e-6 * std::abs(rest));
  const auto [lowest, highest] = std::ranges::minmax(rests);
  const double uneven = moving.empty() ? 0 : std::ranges::max(moving) - std::ranges::min(moving);
  draft.scale.unit = known ? known->scale.unit : whole ? "counts" : "unknown unit";
  says.push_back("at rest " + format(float(lowest)) + " to " + format(float(highest)) + ", median " +
                 format(float(rest)) + ", noise " + format(noise, 3) + " from frame to frame" +
                 (known   ? ""
                  : whole ? "; whole numbers, called counts"
                          : "; set \"unit\""));
  const bool pressed = strongest > 12 * noise, rises = upwards || !pressed;
  const double most = pressed ? 1.1 * strongest : std::max(20 * noise, 0.1 * std::abs(rest));
  if (known && !pressed) {
    draft.scale = known->scale;
  } else {
    draft.scale.rest = rest, draft.scale.span = rises ? -most : most;
  }
  if (pressed ? uneven > 0.02 * most : known.has_value()) {
    draft.rest.assign(rests.begin(), rests.end());
    says.push_back("signals rest up to " + format(uneven, 3) +
                   " apart: \"rest\" moves each to the median; probe again when they have drifted");
  }
  says.push_back(pressed ? std::string("pressing ") + (rises ? "raises" : "lowers") +
                               " the signals, by up to " + format(strongest, 3)
                 : known
                     ? "nothing was pressed: \"pressed\" and \"range\" stay as the file has them"
                     : "nothing was pressed: \"pressed\": \"higher\" and the range are assumed; probe again "
                       "while you press");
  if (2 * still.size() > static_cast<std::size_t>(draft.array.taxels())) {
    says.push_back(std::to_string(still.size()) + " of " + std::to_string(draft.array.taxels()) +
                   " taxels did not change; press each of them while probing to find the dead ones");
  } else if (!still.empty()) {
    says.push_back("stuck or dead, since they never changed: taxels " + nlohmann::json(still).dump());
    for (const int taxel : still)
      if (std::ranges::find(draft.dead, taxel) == draft.dead.end()) draft.dead.push_back(taxel);
  }
}

// Says what it is where it is no sensor.
std::optional<FoundFormat> candidate_of(const std::string& bytes, std::span<const Heard> heard,
                                        const std::optional<Sensor>& known, std::vector<std::string>& says) {
  std::optional<FoundFormat> found;
  const double seconds = heard.empty() ? 0 : heard.back().time_s - heard.front().time_s;
  std::size_t text_bytes = 0, left = 0;  // left: of a character of UTF-8
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const auto c = static_cast<unsigned char>(bytes[i]);
    const std::size_t more = left > 0 || c < 0xC2 || c > 0xF4 ? 0 : c < 0xE0 ? 1 : c < 0xF0 ? 2 : 3;
    const bool goes_on = left > 0 && (c & 0xC0) == 0x80;
    text_bytes +=
        goes_on || more > 0 || (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t' || c == '\x1B';
    left = goes_on ? left - 1 : more;
  }
  // UTF-16 has a NUL beside each character; some firmware sends one with each line.
  const auto nul = static_cast<double>(std::ranges::count(bytes, '\0')),
             all = static_cast<double>(bytes.size());
  const bool padded = nul < 0.1 * all || (nul > 0.45 * all && nul < 0.55 * all);
  if (bytes.empty()) {
    says.push_back(
        "nothing came: see whether the sensor is switched on, and whether address and baud rate are right");
    return found;
  }
  const double printable = static_cast<double>(text_bytes), read = padded ? all - nul : all;
  std::vector<std::string> of_text, of_binary;
  bool text = printable > 0.98 * read;
  if (text) found = find_text_format(bytes, seconds, of_text);
  // Values of bytes may happen to be printable; lines with a NUL beside each character are text.
  const bool wide = padded && nul > 0.1 * all && bytes.find_first_of("\r\n") != std::string::npos;
  if (!found && printable < all && !(text && wide)) {
    const Bytes view(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    const auto binary =
        find_binary_format(view, heard, known ? std::optional(known->values()) : std::nullopt, of_binary);
    const auto shape = binary ? assumed_array(binary->values) : std::nullopt;
    if (shape) found = FoundFormat{binary->format, *shape, "", {}}, text = false;
  }
  const std::vector<std::string>& more = text ? of_text : of_binary;
  says.insert(says.end(), more.begin(), more.end());
  return found;
}

// peak_k, or 0 where it is noise.
double peak_of(const HeardFrames& frames, const Sensor& sensor, std::size_t taxel) {
  const auto channels = static_cast<std::size_t>(sensor.array.channels);
  std::vector<double> changes(frames.count), steps(frames.count - 1);
  for (std::size_t s = taxel * channels; s < (taxel + 1) * channels; ++s) {
    const std::vector<float>& signal = frames.signals[s];
    for (std::size_t i = 0; i < frames.count; ++i) {
      changes[i] = std::hypot(changes[i], double{signal[i]} - double{sensor.rest[s]});
      if (i > 0) steps[i - 1] = std::hypot(steps[i - 1], double{signal[i]} - double{signal[i - 1]});
    }
  }
  const double held = std::min(0.01 * static_cast<double>(frames.count), 0.2 * sensor.rate_hz);
  std::ranges::sort(changes, std::greater());
  const double peak = changes[std::max<std::size_t>(static_cast<std::size_t>(held), 3) - 1];
  return peak > 6 * quantile(steps, 0.75) ? peak : 0;
}

}  // namespace

ProbeReport probe(std::span<const Heard> heard, const std::string& port, const std::optional<Sensor>& known) {
  ProbeReport report;
  std::string bytes;
  for (const Heard& chunk : heard) bytes += chunk.bytes;
  const double seconds = heard.empty() ? 0 : heard.back().time_s - heard.front().time_s;
  report.says.push_back("heard " + std::to_string(bytes.size()) + " bytes in " + format(seconds, 1) + " s");
  Sensor rig;
  rig.port = port;
  const auto reads_all = [&](const Sensor& sensor) {
    return !bytes.empty() && frames_of(sensor, heard).frame_bytes > 0.9 * static_cast<double>(bytes.size());
  };
  if (reads_all(rig)) {
    report.says.push_back("frames of the rig's board");
    report.draft = rig;
    return report;
  }
  // A description that reads what came knows more than what can be guessed.
  const bool reads = known && reads_all(*known);
  const auto found = reads ? std::optional(FoundFormat{known->frame, known->array, "", {}})
                           : candidate_of(bytes, heard, known, report.says);
  Sensor draft = known.value_or(Sensor{.name = "probed sensor", .body = {}});
  draft.port = port, draft.rest.clear();
  if (!found) return report;
  const std::size_t values = reads ? known->values() : found->array.signals();
  if (known && known->values() != values) {
    report.says.push_back("frames of " + std::to_string(values) + " values, expected the " +
                          std::to_string(known->values()) + " of " + known->array.text());
    return report;
  }
  draft.array = known ? known->array : found->array;
  draft.frame = found->format;
  if (!known) draft.dead = found->dead;
  HeardFrames frames = frames_of(draft, heard);
  if (frames.count < 2 || frames.frame_bytes < 0.5 * static_cast<double>(bytes.size())) {
    report.says.push_back("only " + std::to_string(frames.count) +
                          " frames were whole; probe for longer (--seconds)");
    return report;
  }
  const bool guessed = !known && draft.frame.kind == FrameKind::binary;
  if (const std::size_t odd = guessed ? odd_values(frames, draft.frame.type) : 0; odd > 0) {
    report.says.push_back("nothing is drafted: " + std::to_string(odd) +
                          " values of a frame move, or are, as no signal: a checksum of a form that is not "
                          "known, or a counter? Write the file");
    return report;
  }
  if (!found->remark.empty()) report.says.push_back(found->remark);
  const double rate = static_cast<double>(frames.steps) / std::max(frames.seconds, 1e-6);
  const bool unknown_rate = seconds < kAtOnceS && !draft.frame.time;
  draft.rate_hz = unknown_rate ? 100 : std::clamp(std::round(rate * 100) / 100, 1.0, 100'000.0);
  report.says.push_back("frames of " + std::to_string(values) + " values, " +
                        (unknown_rate ? "all at once" : format(draft.rate_hz) + " a second") +
                        (draft.frame.time
                             ? ", with a time stamp in " + format(draft.frame.time->unit_s) + " s"
                             : ", without a time stamp"));
  if (unknown_rate)
    report.says.push_back("assumed: " + format(draft.rate_hz) + " frames a second; set \"rate_hz\"");
  const bool nested = found->array != assumed_array(values);  // by lists of JSON, or rows of lines
  if (const FoundLayout lie = known || nested ? FoundLayout{} : find_layout(frames.signals); lie.layout) {
    draft.array.rows = lie.layout->rows, draft.array.columns = lie.layout->columns;
    draft.reorder(lie.layout->order);
    frames = frames_of(draft, heard);
    report.says.push_back(lie.says);
    report.says.push_back("assumed: taxels " + draft.array.pitch_mm.text() + " mm apart; set \"pitch_mm\"");
  } else if (!known) {
    if (!lie.says.empty()) report.says.push_back(lie.says);
    report.says.push_back("assumed: " + draft.array.text() +
                          "; set \"rows\", \"columns\", \"channels\" and \"pitch_mm\"");
  }
  look_at_signals(draft, frames, known, report.says);
  try {
    draft.check();
    report.draft = draft;
  } catch (const std::exception& e) {  // numbers that no sensor has: the reading is not right
    report.says.push_back(std::string("nothing is drafted, as no sensor could be described so: ") + e.what());
  }
  return report;
}

ProbeReport find_gain(std::span<const Heard> heard, const Sensor& sensor) {
  const HeardFrames frames = frames_of(sensor, heard);
  ProbeReport report{{std::to_string(frames.count) + " frames to find gains from"}, {}};
  if (frames.count <= 3) return report;
  Sensor found = sensor;
  found.rest.clear();
  for (std::vector<float> signal : frames.signals) found.rest.push_back(median(signal));
  const std::vector<int> silent = sensor.silent();
  const auto says = [&](int taxel) { return std::ranges::find(silent, taxel) == silent.end(); };
  std::vector<double> peaks, pressed;  // of silent taxels 0
  for (int taxel = 0; taxel < sensor.array.taxels(); ++taxel)
    peaks.push_back(says(taxel) ? peak_of(frames, found, static_cast<std::size_t>(taxel)) : 0);
  const double least = 0.2 * quantile(std::vector(peaks), 0.9);
  std::ranges::copy_if(peaks, std::back_inserter(pressed), [&](double peak) { return peak > least; });
  if (pressed.empty()) {
    report.says.emplace_back("nothing was pressed: press every taxel while it listens (--seconds)");
    return report;
  }
  const double usual = median(pressed);
  const auto gain_of = [&](double peak) {
    return std::clamp(std::round(1e4 * usual / peak) / 1e4, 0.2, 5.0);
  };
  std::vector<int> weak;
  found.gain.clear();
  for (int taxel = 0; taxel < sensor.array.taxels(); ++taxel) {
    const double peak = peaks[static_cast<std::size_t>(taxel)];
    if (peak <= least && says(taxel)) weak.push_back(taxel);
    found.gain.insert(found.gain.end(), static_cast<std::size_t>(sensor.array.channels),
                      peak > least ? static_cast<float>(gain_of(peak)) : 1);
  }
  const auto [lowest, highest] = std::ranges::minmax(pressed);
  report.says.push_back("gains of " + std::to_string(pressed.size()) + " taxels, " +
                        format(gain_of(highest)) + " to " + format(gain_of(lowest)) +
                        ", from presses that changed a signal by " + format(usual, 3));
  if (!weak.empty())
    report.says.push_back("not pressed, or far more weakly than the others: taxels " +
                          nlohmann::json(weak).dump() +
                          " keep gain 1; press them as hard as the others, or name them in \"dead\"");
  found.check();
  report.draft = found;
  return report;
}

}  // namespace supertac
