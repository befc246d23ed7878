// supertac-stream: super-resolved touch while it happens.

#include <unistd.h>

#include <filesystem>
#include <limits>

#include "apps/common/numerics.h"
#include "apps/common/ports.h"
#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/stream/latency_histogram.h"
#include "apps/stream/picture_log.h"
#include "apps/stream/picture_maker.h"
#include "apps/stream/terminal_view.h"
#include "hardware/serial_port.h"
#include "io/file.h"
#include "io/numbers.h"

namespace supertac {
namespace {

// A picture that would be older than this is not made: where the machine is too slow, or was busy, the newest
// count.
constexpr double kMostLateS = 0.02;
constexpr double kWaitS = 0.05, kFiguresEveryS = 0.5;
constexpr double kForever = std::numeric_limits<double>::infinity();

void declare(Arguments& a) {
  a.option("model", "FILE,...", "model of supertac-train; of several the pictures are averaged")
      .option("board", "PORT", "port of the tactile board; auto finds it by its USB number")
      .option("replay", "JOURNAL",
              "the raw bytes of --capture, or of a supertac-collect run, instead of a board")
      .option("recording", "FILE", "a recording instead of a board")
      .option("seconds", "N", "end after N seconds of signal; default: when the source ends, or at Ctrl-C")
      .option("out", "FILE",
              "keep time, voltages and picture of every frame (safetensors, 1.1 MB/s at 16x16)")
      .option("capture", "JOURNAL", "keep the board's raw bytes (185 kB/s), for --replay")
      .option("speedup", "X", "of a virtual rig started with the same --speedup", "1")
      .flag("list-ports", "list the serial ports and end");
}

struct Options {
  double seconds, speedup;
  std::string source;  // in words
};

Options read_options(const Arguments& a) {
  if (!a.given("model")) throw UsageError("--model: expected a file of supertac-train, found none");
  Options options{kForever, a.number("speedup", 0.1, 100), {}};
  if (a.given("seconds")) options.seconds = a.number("seconds", 0.001, 1e9);
  int sources = 0;
  for (const char* name : {"board", "replay", "recording"}) {
    if (!a.given(name)) continue;
    options.source = std::string(name) + " " + a.text(name);
    ++sources;
  }
  if (sources != 1) {
    throw UsageError("expected one of --board PORT, --replay JOURNAL and --recording FILE, found " +
                     std::to_string(sources));
  }
  if (a.given("capture") && !a.given("board")) throw UsageError("--capture: only with --board");
  return options;
}

std::unique_ptr<SensorSource> open_source(const Arguments& a, const Options& options) {
  if (a.given("replay")) return open_replay(a.text("replay"));
  if (a.given("recording")) return open_recording(a.text("recording"));
  const std::string capture = a.text("capture");
  if (!capture.empty()) {
    refuse_existing(capture, a.force());
    std::filesystem::remove(capture);
  }
  return open_board(a.text("board"), options.speedup, capture);
}

class Stream {
 public:
  Stream(const Arguments& a, double seconds, std::span<const ModelFile> models, SensorSource& source)
      : a_(a), source_(source), maker_(models, source), seconds_(seconds) {
    state_.array = source.array();
    state_.scale = maker_.image().height / state_.array.rows;
    if (a.given("out"))
      log_ = std::make_unique<PictureLog>(a.text("out"), a.force(), source.array().signals(), maker_.image());
  }

  /// Until the source ends, --seconds are over, or a signal comes.
  void run() {
    if (!a_.quiet() && drawable_terminal()) view_ = std::make_unique<TerminalView>();
    while (!interrupted()) {
      const auto frame = source_.next(kWaitS);
      if (frame && !take(*frame)) break;
      if (!frame && source_.ended()) break;
      show();
    }
    view_.reset();
  }

  void finish(const std::map<std::string, std::string>& metadata) {
    view_.reset();
    if (log_) log_->write(metadata);
    source_.finish();
  }

  std::uint64_t pictures() const { return latency_.count(); }
  double window_s() const { return maker_.window_s(); }

  std::string summary() {
    const BoardCounters counters = source_.counters();
    return std::to_string(frames_) + " frames in " + format(last_s_ - first_s_, 1) + " s, " +
           std::to_string(pictures()) + " pictures, latency median " + format(milliseconds(0.5), 2) +
           " ms, p99 " + format(milliseconds(0.99), 2) + " ms; lost " + std::to_string(counters.missing) +
           ", dropped " + std::to_string(dropped());
  }

  nlohmann::ordered_json result() {
    const BoardCounters counters = source_.counters();
    const LiveWindow::Counters& window = maker_.window().counters();
    return {{"seconds", last_s_ - first_s_},
            {"frames", frames_},
            {"pictures", pictures()},
            {"lost", counters.missing},
            {"dropped", dropped()},
            {"suspect", counters.suspect},
            {"jumps", counters.jumps},
            {"gaps", window.gaps},
            {"board_period_us", 1e6 * counters.clock.period_s},
            {"latency_ms",
             {{"median", milliseconds(0.5)},
              {"p99", milliseconds(0.99)},
              {"p99.9", milliseconds(0.999)},
              {"max", 1e3 * latency_.max()}}}};
  }

 private:
  /// False when the time is over.
  bool take(SensorFrame frame) {
    if (frames_ == 0) first_s_ = frame.time_s, begin_s_ = monotonic_seconds();
    if (frame.time_s - first_s_ >= seconds_) return false;
    if (view_ && !source_.live()) frame.arrived_s = keep_pace(frame.time_s);
    ++frames_;
    last_s_ = frame.time_s;
    maker_.push(frame);
    if (source_.live() && monotonic_seconds() - frame.arrived_s > kMostLateS) {
      ++too_late_;
      return true;
    }
    const std::span<const float> picture = maker_.picture();
    if (picture.empty()) return true;
    latency_.add(monotonic_seconds() - frame.arrived_s);
    if (log_) log_->add(frame.time_s - first_s_, frame.volts, picture);
    state_.picture.assign(picture.begin(), picture.end());
    return true;
  }

  /// Where somebody watches, what was recorded passes as fast as it happened.
  double keep_pace(double time_s) const {
    const double due = begin_s_ + time_s - first_s_;
    for (double now = monotonic_seconds(); now < due && !interrupted(); now = monotonic_seconds())
      usleep(static_cast<useconds_t>(1e6 * std::min(due - now, kWaitS)));
    return monotonic_seconds();
  }

  void show() {
    if (!view_) return;
    const double now = monotonic_seconds();
    if (now - figures_s_ >= kFiguresEveryS) {
      const BoardCounters counters = source_.counters();
      state_.frames_per_s = static_cast<double>(frames_ - figures_frames_) / (now - figures_s_);
      state_.median_ms = milliseconds(0.5), state_.p99_ms = milliseconds(0.99);
      state_.lost = counters.missing, state_.dropped = dropped();
      figures_s_ = now, figures_frames_ = frames_;
    }
    state_.taxels = mean_of_channels(state_.array, maker_.window().newest());
    view_->update(state_);
  }

  double milliseconds(double quantile) const { return 1e3 * latency_.quantile(quantile); }
  std::uint64_t dropped() { return too_late_ + source_.counters().dropped; }

  const Arguments& a_;
  SensorSource& source_;
  PictureMaker maker_;
  double seconds_;
  std::unique_ptr<PictureLog> log_;
  std::unique_ptr<TerminalView> view_;
  LatencyHistogram latency_;
  LiveState state_;
  std::uint64_t frames_ = 0, too_late_ = 0, figures_frames_ = 0;
  double first_s_ = 0, last_s_ = 0;  // the sensor's time
  double begin_s_ = 0, figures_s_ = monotonic_seconds();
};

int run(Arguments& a) {
  if (a.flag("list-ports")) {
    print_ports(a);
    return kExitOk;
  }
  const double begin = monotonic_seconds();
  const Options options = read_options(a);
  const std::vector<ModelFile> models = load_models(a.list("model"));
  const auto source = open_source(a, options);
  Stream stream(a, options.seconds, models, *source);
  const double ready_ms = 1e3 * (monotonic_seconds() - begin);
  a.note("ready: " + options.source + "; a picture needs " + format(stream.window_s(), 2) + " s of signal");
  std::exception_ptr error;
  try {
    stream.run();
  } catch (...) {
    error = std::current_exception();  // what was seen before is kept
  }
  stream.finish({{"kind", "pictures"}, {"model", a.text("model")}, {"source", options.source}});
  a.print(stream.summary());
  nlohmann::ordered_json result = {
      {"source", options.source}, {"model", a.text("model")}, {"ready_ms", ready_ms}};
  result.update(stream.result());
  a.write_json(result);
  if (error) std::rethrow_exception(error);
  if (stream.pictures() == 0 && !interrupted()) {
    throw std::runtime_error(options.source + ": no picture, expected " + format(stream.window_s(), 2) +
                             " s of signal without a gap of 0.05 s; stream for longer");
  }
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"supertac-stream", "Shows super-resolved pictures live.", supertac::declare,
                                  supertac::run, supertac::numerics};
  return supertac::run_program(program, argc, argv);
}
