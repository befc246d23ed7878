#include "apps/stream/stream.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "apps/common/running/signals.h"
#include "apps/web/pages.h"
#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kMostLateS = 0.02, kWaitS = 0.05, kFiguresEveryS = 0.5, kShowEveryS = 1.0 / 60;

double wall_clock_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

std::string status_line(const LiveState& state) {
  const std::string line =
      format(state.frames_per_s, 0) + " frames/s  latency " + format(state.median_ms, 2) + " ms (p99 " +
      format(state.p99_ms, 2) + ")  lost " + std::to_string(state.lost) + "  dropped " +
      std::to_string(state.dropped) +
      (state.uncertainty() > 0 ? "  +-" + format(state.uncertainty(), 2) : "") +
      (std::isfinite(state.x_mm) ? "  at x " + format(static_cast<double>(state.x_mm), 1) + " y " +
                                       format(static_cast<double>(state.y_mm), 1) + " mm"
                                 : "");
  return (state.unlike_training ? "UNLIKE TRAINING  " : "") + line;  // in front: never cut
}

Stream::Stream(const StreamSettings& settings, std::span<const ModelFile> models, SensorSource& source)
    : settings_(settings),
      source_(source),
      maker_(models.empty() ? nullptr : std::make_unique<PictureMaker>(models, source, settings.precision)),
      raw_(source),
      figures_s_(monotonic_seconds()) {
  const char* const tensor = signals_tensor(source.signal_scale());
  const PictureFormat signals{.signals = source.array().signals(), .image = {0, 0}, .tensor = tensor};
  PictureFormat format = maker_ ? maker_->format() : signals;
  format.tensor = tensor;
  describe_recording();
  settings_.metadata.merge(metadata_of(source.array(), source.signal_scale()));
  if (maker_) settings_.metadata["pixel_mm"] = json_of(maker_->image().pixel_mm).dump();
  // Two programs may record the same pass: both are kept.
  const OutputPath record(record_path_, [this](const std::string& line) { record_remark_ = line; });
  if (!settings.record.empty()) record_ = std::make_unique<PictureLog>(record, signals);
  if (settings.out.path == "-")
    pipe_ = std::make_unique<PipeOutput>(STDOUT_FILENO, !source.live());
  else if (!settings.out.path.empty())
    log_ = std::make_unique<PictureLog>(settings.out, format);
  if (!settings.mcap.path.empty())
    mcap_ = std::make_unique<McapLog>(settings.mcap, source.array(), source.signal_scale(), format.image,
                                      format.half_widths);
  if (maker_ && (settings.web || !settings.map.path.empty()))
    map_.emplace(maker_->image(), models.front().model->settings().timesteps > 1);
  about_lines_ = about_lines(source.array(), source.signal_scale().unit, format.image);
  if (settings.web) open_page(signals, format);
}

void Stream::open_page(const PictureFormat& recorded, const PictureFormat& format) {
  recorder_ = std::make_unique<Recorder>(recorded, recording_);
  if (settings_.draft)
    order_ = std::make_unique<PressedOrder>(*settings_.draft, source_.silent(), settings_.draft_file);
  const TaxelArray& array = source_.array();
  nlohmann::json hello = {{"badge", settings_.badge},
                          {"source", settings_.source},
                          {"rows", array.rows},
                          {"columns", array.columns},
                          {"channels", array.channels},
                          {"pitch_mm", {array.pitch_mm.x, array.pitch_mm.y}},
                          {"scale", maker_ ? format.image.height / array.rows : 1},
                          {"predicts_error", format.half_widths},
                          {"unit", source_.signal_scale().unit},
                          {"draws", maker_ != nullptr},
                          {"delay_s", maker_ ? maker_->delay_s() : 0},
                          {"silent", source_.silent()},
                          {"found", settings_.found},
                          {"colours", colour_map_base64()}};
  web_ = std::make_unique<WebView>(
      *settings_.web, std::move(hello), [this](MapCells cells) { return named(std::move(cells)); },
      *recorder_, order_.get());
}

// The next pass of this plate in the folder.
void Stream::describe_recording() {
  Recording about;
  about.array = source_.array(), about.signal_scale = source_.signal_scale();
  about.body = source_.sensor().body;
  about.plate = std::filesystem::path(settings_.plate).filename().string();
  about.trial = 1, about.source = "streamed";
  if (source_.filter_s() > 0) about.metadata["filter_s"] = format(source_.filter_s());
  if (!source_.sensor().rest.empty()) about.metadata["rest"] = nlohmann::json(source_.sensor().rest).dump();
  if (!source_.silent().empty()) about.metadata["silent_taxels"] = nlohmann::json(source_.silent()).dump();
  about.metadata["origin"] = settings_.source;
  if (!settings_.record.empty()) {
    make_directories(settings_.record);
    keep_plate_file(settings_.plate, settings_.record);
  }
  std::error_code error;
  do {
    ++about.pass;
    record_path_ = settings_.record + "/" + recording_file_name(about);
  } while (!settings_.record.empty() && std::filesystem::exists(record_path_, error));
  recording_ = metadata_of(about);
}

void Stream::run() {
  if (settings_.view) view_ = std::make_unique<TerminalLine>();
  while (!interrupted()) {
    const auto frame = source_.next(kWaitS);
    if (frame && !take(*frame)) break;
    if (!frame && source_.ended()) break;
    if (!frame && pipe_) pipe_->write_waiting();
    show();
  }
  view_.reset();
}

void Stream::finish(const std::string& failure) {
  view_.reset();
  const auto tell = [this](const std::string& outcome, bool failed) {
    const std::string kept = recorder_ ? recorder_->finish() : "";
    if (web_) web_->end(outcome + (kept.empty() ? "" : "; " + kept), failed);
    web_.reset();
    recorder_.reset();
  };
  try {
    complete();
  } catch (const std::exception& error) {
    tell(error.what(), true);
    throw;
  }
  tell(failure.empty() ? "done: " + summary() : failure, !failure.empty());
}

void Stream::complete() {
  lines_lost_ = pipe_ ? pipe_->lost() : 0;
  pipe_.reset();
  std::exception_ptr first;  // what goes wrong with one file is no reason to lose another
  const auto attempt = [&first](const auto& work) {
    try {
      work();
    } catch (const std::exception&) {
      if (!first) first = std::current_exception();
    }
  };
  if (record_) attempt([&] { record_->write(recording_); });
  if (log_) attempt([&] { log_->write(maker_ ? settings_.metadata : recording_); });
  const bool any = maker_ ? pictures() > 0 : frames_ > 0;
  if (mcap_ && any) attempt([&] { mcap_->close(); });
  if (!settings_.map.path.empty()) attempt([&] { write_map(); });
  attempt([&] { source_.finish(); });
  if (first) std::rethrow_exception(first);
}

void Stream::write_map() const {
  if (!map_ || map_->empty())
    throw std::runtime_error(
        settings_.map.path +
        ": no map, since no picture's place is known; expected --model and a --recording "
        "with positions, which supertac-collect and supertac-import give");
  NamedMap map = named(map_->cells(map_->felt()));
  if (!settings_.elements.empty()) draw_as(map, settings_.elements);
  write_maps(settings_.map, {map});
}

NamedMap Stream::named(MapCells cells) const {
  maker_->interval().half_widths(cells.values, cells.region.width, cells.errors, cells.errors);
  NamedMap map{.name = "surface", .cells = std::move(cells), .cell_mm = map_->grid().pixel_mm};
  recognise(map, settings_.elements.empty() ? kinds_of_elements(kAnyKind) : settings_.elements);
  return map;
}

std::string Stream::rate_remark() const {
  constexpr double kLongEnoughS = 1, kMostOff = 1.05;
  const double seconds = last_s_ - first_s_, stated = 1 / source_.period_s();
  const std::uint64_t lost = source_.counters().missing + dropped();
  const double found = static_cast<double>(frames_ + lost - 1) / seconds;
  if (!source_.live() || seconds < kLongEnoughS || (found < kMostOff * stated && stated < kMostOff * found))
    return "";
  return "; " + format(found, 1) + " frames came a second, the sensor is said to send " + format(stated, 1) +
         ": correct rate_hz in its file";
}

std::string Stream::summary() const {
  const ReaderCounters counters = source_.counters();
  return std::to_string(frames_) + " frames in " + format(last_s_ - first_s_, 1) + " s, " +
         std::to_string(pictures()) + (maker_ ? " pictures" : " shown") + ", latency median " +
         format(milliseconds(0.5), 2) + " ms, p99 " + format(milliseconds(0.99), 2) + " ms; lost " +
         std::to_string(counters.missing) + ", dropped " + std::to_string(dropped()) +
         (counters.resets > 0 ? ", the sensor started anew " + std::to_string(counters.resets) + " times"
                              : "") +
         (lines_lost_ > 0 ? ", " + std::to_string(lines_lost_) + " lines not taken by their reader" : "") +
         (unlike_ > 0 ? ", " + std::to_string(unlike_) + " pictures of signals unlike training" : "") +
         (map_ && !map_->empty() ? "; map of " + elements_text(named(map_->cells(map_->felt()))) : "") +
         (record_ ? "; recorded " + record_path_ : "") +
         (record_ && record_->left_out() > 0
              ? ", " + std::to_string(record_->left_out()) + " frames left out, their time being uncertain"
              : "") +
         (record_remark_.empty() ? "" : "; " + record_remark_) + rate_remark();
}

nlohmann::ordered_json Stream::result() const {
  const ReaderCounters counters = source_.counters();
  nlohmann::ordered_json result = {{"seconds", last_s_ - first_s_},
                                   {"frames", frames_},
                                   {"pictures", pictures()},
                                   {"unlike_training", unlike_},
                                   {"lost", counters.missing},
                                   {"dropped", dropped()},
                                   {"resets", counters.resets},
                                   {"suspect", counters.suspect},
                                   {"jumps", counters.jumps},
                                   {"gaps", gaps()},
                                   {"lines_lost", lines_lost_},
                                   {"board_period_us", 1e6 * counters.period_s},
                                   {"latency_ms",
                                    {{"median", milliseconds(0.5)},
                                     {"p99", milliseconds(0.99)},
                                     {"p99.9", milliseconds(0.999)},
                                     {"max", 1e3 * latency_.max()}}}};
  if (record_) result["recording"] = record_remark_.empty() ? record_path_ : record_remark_;
  if (record_) result["left_out"] = record_->left_out();
  return result;
}

// False when the time is over.
bool Stream::take(SensorFrame frame) {
  if (frames_ == 0) first_s_ = frame.time_s, begin_s_ = monotonic_seconds();
  if (frame.time_s - first_s_ >= settings_.seconds) return false;
  if ((view_ || web_) && !source_.live()) frame.arrived_s = keep_pace(frame.time_s);
  if (source_.live()) {
    // One offset for all frames, however the system's clock is set meanwhile; only a sensor that begins anew
    // has another.
    if (frames_ == 0 || frame.time_s < last_s_)
      wall_offset_s_ = wall_clock_seconds() - (monotonic_seconds() - frame.arrived_s) - frame.time_s;
    frame.wall_s = frame.time_s + wall_offset_s_;
  }
  ++frames_;
  last_s_ = frame.time_s;
  const bool rezero = web_ && web_->take_rezero();
  raw_.push(frame.signals);
  if (rezero && maker_) maker_->rezero(raw_.resting());
  if (rezero) raw_.rezero();
  if (order_) order_->push(raw_.loads());
  if (record_ || recorder_ || !maker_) keep_raw(frame);
  if (!maker_) return true;
  maker_->push(frame);
  // The first is the newest that is as old as what the next picture shows.
  if (!places_.empty() && frame.time_s < places_.back().time_s) places_.clear();
  places_.push_back({frame.time_s, frame.x_mm, frame.y_mm, frame.lift_mm});
  while (places_.size() > 1 && places_[1].time_s <= frame.time_s - maker_->delay_s() + kCellSlack)
    places_.pop_front();
  if (source_.live() && monotonic_seconds() - frame.arrived_s > kMostLateS) {
    ++too_late_;
    return true;
  }
  const std::span<const float> picture = maker_->picture();
  if (picture.empty()) return true;
  keep(frame, picture);
  return true;
}

// A frame with a signal that is no number has no place in a recording.
void Stream::keep_raw(const SensorFrame& frame) {
  if (!std::ranges::all_of(frame.signals, [](float v) { return std::isfinite(v); })) return;
  const LiveFrame seen{.number = frames_ - 1,
                       .time_s = frame.time_s - first_s_,
                       .wall_s = frame.wall_s,
                       .signals = frame.signals,
                       .picture = {},
                       .half_widths = {},
                       .arrival = frame.arrival,
                       .distance = {}};
  if (record_) record_->add(seen);
  if (recorder_) recorder_->add(seen);
  if (!maker_) output(frame, seen);
}

void Stream::output(const SensorFrame& frame, const LiveFrame& seen) {
  latency_.add(monotonic_seconds() - frame.arrived_s);
  state_.number = seen.number, state_.time_s = seen.time_s;
  state_.x_mm = frame.x_mm, state_.y_mm = frame.y_mm;
  if (log_) log_->add(seen);
  if (mcap_) mcap_->add(seen);
  if (!pipe_) return;
  const SignalScale scale = source_.signal_scale();
  const FrameLoad load = load_of(seen.signals, source_.array().channels, scale);
  pipe_->send(picture_line(seen, load, scale, state_.unlike_training, about_lines_));
}

void Stream::keep(const SensorFrame& frame, std::span<const float> picture) {
  state_.unlike_training = maker_->unlike_training();
  unlike_ += state_.unlike_training ? 1 : 0;
  output(frame, {.number = pictures(),
                 .time_s = frame.time_s - first_s_,
                 .wall_s = frame.wall_s,
                 .signals = maker_->signals(),
                 .picture = picture,
                 .half_widths = maker_->half_widths(),
                 .distance = maker_->distance()});
  state_.picture.assign(picture.begin(), picture.end());
  const Place& shown = places_.front();
  if (!map_ || !std::isfinite(shown.x_mm) || !std::isfinite(shown.y_mm) || shown.lift_mm > kLiftedMm) return;
  map_->add(shown.x_mm, shown.y_mm, picture, maker_->predicted_errors());
  changed_ = changed_.with(map_->newest());
}

double Stream::keep_pace(double time_s) const {
  const double due = begin_s_ + time_s - first_s_;
  for (double now = monotonic_seconds(); now < due && !interrupted(); now = monotonic_seconds())
    usleep(static_cast<useconds_t>(1e6 * std::min(due - now, kWaitS)));
  return monotonic_seconds();
}

void Stream::show() {
  const double now = monotonic_seconds();
  if ((!view_ && !web_) || now - shown_s_ < kShowEveryS) return;
  shown_s_ = now;
  if (now - figures_s_ >= kFiguresEveryS) {
    const ReaderCounters counters = source_.counters();
    state_.frames_per_s = static_cast<double>(frames_ - figures_frames_) / (now - figures_s_);
    state_.median_ms = milliseconds(0.5), state_.p99_ms = milliseconds(0.99);
    state_.lost = counters.missing, state_.dropped = dropped();
    figures_s_ = now, figures_frames_ = frames_;
  }
  if (maker_) {
    state_.half_widths.assign(maker_->half_widths().begin(), maker_->half_widths().end());
    state_.distance = maker_->distance();
  }
  if (frames_ > 0)
    state_.taxels = raw_.taxels(), state_.top = raw_.top(), state_.most_changed = raw_.most_changed();
  if (order_) state_.order = order_->status();
  if (view_) view_->show(status_line(state_));
  if (web_ && web_->update(state_, map_ ? &*map_ : nullptr, changed_)) changed_ = {};
}

}  // namespace supertac
