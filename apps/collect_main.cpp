// supertac-collect: runs the finger over a plate and records every pass with a position for every frame.

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>

#include "apps/collect/collect_view.h"
#include "apps/collect/passes.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/web/web_server.h"
#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/port.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments
      .option("sensor", "FILE", "what the head carries: a sensor's file, whose port is read, or rig", "rig")
      .option("board", "PORT", "port of the rig's tactile board; auto finds it by its USB number", "auto")
      .required("printer", "PORT", "port of the Marlin printer")
      .required("plate", "NAME",
                "plate under the finger (3_Bumps, ..., plain, kind and pitch: ridges6, or FILE.stl)")
      .option("bed", "FILE",
              "where the printer's plate lies, where its head waits and how it slides (docs/sensors.md); "
              "without it as on the rig")
      .required("out", "DIR", "folder for journal, recordings and report")
      .writes()
      .option("speed", "MM_PER_S", "of the slide, instead of what the bed's file says", "10")
      .option("passes", "N",
              "slides, on the rig 5 mm apart in x and at most 8, instead of what the bed's file says", "8")
      .option("trial", "N", "number of this trial, for the recordings' names", "1")
      .option("speedup", "X", "of a virtual rig started with the same --speedup", "1")
      .flag("home", "home the printer first instead of trusting the operator's origin")
      .flag("confirm-origin", "after a run that was cut off: the head is back at its origin, on the rig " +
                                  describe(rig::kMounted))
      .flag("yes", "do not ask: the plate lies as planned and the head is at its origin");
  declare_web(arguments);
}

namespace {

constexpr int kMostPasses = 1000;

namespace fs = std::filesystem;

// The place of the XDG base directory specification, which has a relative path ignored.
fs::path state_folder() {
  const char* state = getenv("XDG_STATE_HOME");
  if (state != nullptr && fs::path(state).is_absolute()) return state;
  const char* home = getenv("HOME");
  if (home != nullptr && fs::path(home).is_absolute()) return fs::path(home) / ".local/state";
  throw FileError(
      "XDG_STATE_HOME",
      "expected a folder that remembers where the printer was left, found neither it nor HOME; set one");
}

/// Says that nobody knows where a printer's head is: set while a run moves it, and left by one that did not
/// end with the head back at its origin, were it by kill -9 or a power cut. It belongs to the printer, not to
/// a folder of recordings: a file $XDG_STATE_HOME/supertac/origin-unknown/PORT (~/.local/state/...).
class OriginMark {
 public:
  /// Throws FileError when there is no place for it.
  explicit OriginMark(const std::string& printer_port)
      : file_((state_folder() / "supertac/origin-unknown").string() + lasting_port_name(printer_port)) {}
  bool is_set() const {
    std::error_code error;
    const bool found = fs::exists(file_, error);
    return found || error;  // what cannot be looked at may be there
  }
  /// On the disk when it returns. Throws FileError
  void set() const {
    make_directories(fs::path(file_).parent_path().string());
    write_file(file_, "the head's position is unknown until a run on this printer has ended at its origin\n");
  }
  /// Throws FileError
  void clear() const {
    std::error_code error;
    fs::remove(file_, error);
    if (error) throw FileError(file_, "cannot be removed: " + error.message() + "; remove it by hand");
  }

 private:
  std::string file_;
};

/// A line from the terminal. std::getline goes on waiting after a signal.
std::string ask_operator() {
  std::string answer;
  for (char c = 0; c != '\n';) {
    pollfd terminal{STDIN_FILENO, POLLIN, 0};
    (void)poll(&terminal, 1, 50);
    stop_if_interrupted();
    if (terminal.revents == 0) continue;
    if (read(STDIN_FILENO, &c, 1) != 1) return answer;
    if (c != '\n' && answer.size() < 100) answer.push_back(c);
  }
  return answer;
}

void confirm(const Arguments& arguments, const RecorderSettings& settings) {
  const PalpationPlan& plan = settings.bed.plan;
  arguments.note("plan: " + std::to_string(plan.passes) + " passes of " + format(plan.slide, 0) + " mm at " +
                 format(plan.speed, 1) + " mm/s from " + describe(plan.start) + ", lift " +
                 format(plan.lift, 0) + " mm");
  if (arguments.flag("yes")) return;
  if (isatty(STDIN_FILENO) == 0) throw UsageError("--yes: needed where nobody can be asked");
  std::cerr << (settings.home ? "Is the bed free, so that the printer can home?"
                              : "Is the head at " + describe(settings.bed.origin) + ", the plate below it?")
            << " [yes/no] ";
  const std::string answer = ask_operator();
  if (answer != "yes" && answer != "y")
    throw UsageError("expected yes, found " + in_quotes(answer) + "; nothing was moved");
}

int trial_of(const Arguments& arguments) { return static_cast<int>(arguments.integer("trial", 1, 1000)); }

RecorderSettings read_settings(const Arguments& arguments, const std::string& out, const std::string& plate) {
  RecorderSettings settings;
  settings.sensor = read_sensor(arguments.text("sensor"));
  const bool bed_given = arguments.given("bed");
  if (bed_given) settings.bed = read_bed(arguments.text("bed"));
  const Bed bed = settings.bed;
  PalpationPlan& plan = settings.bed.plan;
  if (!bed_given || arguments.given("speed")) plan.speed = arguments.number("speed", 0.5, rig::kFastestMmS);
  if (!bed_given || arguments.given("passes"))
    plan.passes = static_cast<int>(arguments.integer("passes", 1, bed_given ? kMostPasses : rig::kPasses));
  settings.home = arguments.flag("home");
  // Nothing is opened for a plan that leaves the limits; where homing ends is not known yet.
  if (!settings.home) (void)legs_within(bed.limits, plan, bed.origin);
  const int trial = trial_of(arguments);
  settings.header = collection_header(plate, trial, plan.speed, settings.sensor, bed);
  settings.journal = journal_path(out, plate, trial, plan.speed);
  return settings;
}

std::string live_text(const Point3& at, const ReaderCounters& board) {
  return "X" + format(at.x, 1) + " Y" + format(at.y, 1) + "  " + format(1 / board.period_s, 0) +
         " frames/s  " + std::to_string(board.missing) + " lost";
}

/// A run that may move the head: marked until the head is back, or until it turns out that nothing could be
/// moved.
RecorderReport record_marked(std::unique_ptr<Port> board, std::unique_ptr<Port> printer,
                             RecorderSettings settings, const OriginMark& mark) {
  const bool marked_before = mark.is_set();
  mark.set();
  std::optional<FinishDespiteSignals> finger_first;
  settings.contact = [&finger_first](bool contact) {
    contact ? static_cast<void>(finger_first.emplace()) : finger_first.reset();
  };
  try {
    RecorderReport report = record_palpation(std::move(board), std::move(printer), settings);
    if (report.outcome.complete) mark.clear();
    return report;
  } catch (...) {
    if (!marked_before && !settings.home) mark.clear();
    stop_if_interrupted();
    throw;
  }
}

void demand_origin(const Arguments& arguments, const OriginMark& mark, const Point3& origin) {
  if (!mark.is_set() || arguments.flag("home") || arguments.flag("confirm-origin")) return;
  throw OriginUnknown("collect: the last run on printer " + arguments.text("printer") +
                      " did not end at its origin, so the head's position is unknown; move it to " +
                      describe(origin) + " and add --confirm-origin, or use --home");
}

/// What the head carries, on the printer's clock.
std::unique_ptr<Port> open_carried(const Arguments& arguments, Sensor sensor, double speedup) {
  if (arguments.given("board")) {
    if (sensor.frame.kind != FrameKind::board)
      throw UsageError("--board: only with the rig's board; the file of --sensor names its port");
    sensor.port = "serial:" + arguments.text("board") + "@" + std::to_string(rig::kBoardBaud);
  }
  if (speedup != 1 && !sensor.port.starts_with("serial:"))
    throw UsageError("--speedup: only with a sensor at a serial port, found " + in_quotes(sensor.port));
  OpenedPort opened = open_port(sensor, speedup);
  if (opened.stored)
    throw PortError("port " + sensor.port +
                    ": is a file, whose frames were made before; expected the sensor");
  return std::move(opened.port);
}

/// The page of --web; none without.
std::unique_ptr<CollectView> web_view(const Arguments& arguments, const Bed& bed) {
  const auto address = web_address(arguments);
  if (!address) return nullptr;
  auto view = std::make_unique<CollectView>(*address, Plate::named(arguments.text("plate")), bed,
                                            arguments.number("speedup", 0.1, 100),
                                            arguments.text("printer") + ", into " + arguments.text("out"));
  arguments.note("live page: " + view->url());
  return view;
}

/// What the run will write must not be there: it would be found out when all is done.
void refuse_taken(const Arguments& arguments, const std::string& out, const std::string& journal,
                  Recording named, int passes) {
  std::vector<std::string> names = {journal};
  for (named.pass = 1; named.pass <= passes && !arguments.force(); ++named.pass)
    names.push_back(out + "/" + recording_file_name(named));
  for (const std::string& name : names) {
    std::error_code error;
    if (!fs::exists(fs::symlink_status(name, error))) continue;
    throw FileError(
        name, std::string("exists already; collect with another --trial") +
                  (name == journal ? ", for no journal is replaced (supertac-import --journal recovers one)"
                                   : ", or pass --force to replace it"));
  }
}

PalpationOutcome collect(const Arguments& arguments, std::unique_ptr<Port> board,
                         std::unique_ptr<Port> printer, RecorderSettings settings, const OriginMark& mark) {
  const std::unique_ptr<CollectView> page = web_view(arguments, settings.bed);
  confirm(arguments, settings);
  settings.stop = interrupted;
  const double all_s = planned_s(settings.bed);
  Progress progress(arguments, "collecting", static_cast<std::uint64_t>(all_s), "s");
  const double speedup = arguments.number("speedup", 0.1, 100);
  settings.progress = [&](const Leg& leg, const Point3& at, const ReaderCounters& counters) {
    const double left_s = seconds_left(leg, at);
    progress.update(static_cast<std::uint64_t>(std::max(0.0, all_s - left_s)), live_text(at, counters),
                    left_s / speedup);
    if (page) page->update(leg, at, counters);
  };
  try {
    RecorderReport report = record_marked(std::move(board), std::move(printer), settings, mark);
    const bool complete = report.outcome.complete;
    if (!report.kept.empty()) arguments.note("the printer keeps what this run has set: " + report.kept);
    const std::string passes = std::to_string(report.outcome.passes_done) + " passes";
    if (page)
      page->end(complete ? "done: " + passes : "incomplete after " + passes + "; " + report.outcome.note,
                !complete);
    return report.outcome;
  } catch (const std::exception& error) {
    if (page) page->end(error.what(), true);
    throw;
  }
}

/// Recordings, quality report and --json of what was collected, complete or not.
PassesReport keep_passes(const Arguments& arguments, const std::string& journal,
                         const PalpationOutcome& outcome) {
  OutputFolder folder(arguments.output("out"));
  PassesReport report = write_passes(arguments, journal, folder);
  report.json["passes_done"] = outcome.passes_done;
  report.json["note"] = outcome.note;
  constexpr bool kDespiteSignals = true;
  if (report.frames + report.left_out > 0) {
    folder.keep(kDespiteSignals);
  } else {  // this run's own, which would be in the way of the next and could not be imported
    fs::remove(journal);
    report.json["journal"] = nullptr;
  }
  arguments.write_json(report.json);
  return report;
}

/// What ended a run, to stand before what went wrong behind it.
std::string cause_of(const PalpationOutcome& outcome) {
  try {
    if (outcome.error) std::rethrow_exception(outcome.error);
  } catch (const std::exception& ended) {
    return ended.what() + std::string("; ");
  }
  return {};
}

}  // namespace

int run(Arguments& arguments) {
  const std::string out = arguments.text("out");
  const std::string plate =
      read_option("plate", [&] { return Plate::named(arguments.text("plate")).name(); });
  const RecorderSettings settings = read_settings(arguments, out, plate);
  const OriginMark mark(arguments.text("printer"));
  const double speedup = arguments.number("speedup", 0.1, 100);
  auto board = open_carried(arguments, settings.sensor, speedup);
  auto printer =
      std::make_unique<SerialPort>(arguments.text("printer"), SerialSettings{settings.bed.baud, speedup});
  demand_origin(arguments, mark, settings.bed.origin);
  make_directories(out);
  const FolderLock alone(out);
  Recording named;
  named.plate = plate, named.trial = trial_of(arguments), named.speed_mm_s = settings.bed.plan.speed;
  refuse_taken(arguments, out, settings.journal, named, settings.bed.plan.passes);
  keep_plate_file(arguments.text("plate"), out);
  const PalpationOutcome outcome = collect(arguments, std::move(board), std::move(printer), settings, mark);
  if (!outcome.complete)
    arguments.note("incomplete after " + std::to_string(outcome.passes_done) + " passes; " + outcome.note);
  PassesReport report;
  try {
    report = keep_passes(arguments, settings.journal, outcome);
  } catch (const std::exception& error) {
    throw std::runtime_error(cause_of(outcome) + error.what() + "; the journal " + settings.journal +
                             " is kept, make recordings of it with supertac-import --journal");
  }
  if (outcome.complete) {
    const std::string all = std::to_string(outcome.passes_done) + " passes, " + report.total();
    if (report.undated > 0)
      throw std::runtime_error(all +
                               "; collect again on a computer that is less busy, or have the sensor send its "
                               "own time (\"time\" in its file); the journal is kept");
    arguments.print(all);
    return kExitOk;
  }
  stop_if_interrupted();
  std::rethrow_exception(outcome.error);
}

}  // namespace supertac
