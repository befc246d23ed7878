// supertac-stream: super-resolved touch while it happens.

#include <filesystem>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/stream/stream.h"
#include "apps/web/web_server.h"
#include "data/plates/plate.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

/// The option that names the source. Throws UsageError when it is not exactly one, and for what does not go
/// together.
std::string source_option(const Arguments& a) {
  std::vector<std::string> sources = {"sensor", "board", "replay", "recording"};
  std::erase_if(sources, [&](const std::string& name) { return !a.given(name); });
  if (sources.size() != 1)
    throw UsageError(
        "expected one of --sensor FILE, --board PORT, --replay JOURNAL and --recording FILE, found " +
        std::to_string(sources.size()));
  if (a.text("out") == "-" && a.text("json") == "-") throw UsageError("--out and --json: only one to stdout");
  if (!is_unknown_plate(a.text("plate"))) read_option("plate", [&] { return Plate::named(a.text("plate")); });
  if (a.given("map")) read_option("map", [&] { return check_map_path(a.text("map")), 0; });
  return sources.front();
}

std::unique_ptr<SensorSource> open_source(const Arguments& a, double speedup) {
  if (a.given("replay")) return open_replay(a.text("replay"), [&](const std::string& line) { a.note(line); });
  if (a.given("recording")) return open_recording(a.text("recording"));
  if (a.given("sensor")) return open_sensor(read_sensor(a.text("sensor")), speedup);
  const std::string capture = a.text("capture");
  Sensor board;
  board.port = "serial:" + a.text("board") + "@" + std::to_string(rig::kBoardBaud);
  return open_sensor(board, speedup, capture);
}

/// What the pictures come from; a board at a pseudo-terminal is a virtual rig.
std::string badge_of(const std::string& source, const std::string& named) {
  std::error_code error;
  const std::string device = std::filesystem::canonical(named, error).string();
  return source != "board" ? source : device.starts_with("/dev/pts/") ? "virtual rig" : source;
}

}  // namespace

void declare(Arguments& a) {
  a.option("model", "FILE,...",
           "model of supertac-train; of several as supertac-evaluate; without one the array itself is shown")
      .option("sensor", "FILE", "the sensor that this file describes (docs/sensors.md), or 'rig'")
      .option("board", "PORT", "port of the rig's tactile board; auto finds it by its USB number")
      .option("replay", "JOURNAL",
              "the raw bytes of --capture, or of a supertac-collect run, instead of a board")
      .option("recording", "FILE", "a recording instead of a board")
      .option("seconds", "N", "end after N seconds of signal; default: when the source ends, or at Ctrl-C")
      .option("out", "FILE",
              "keep time, signals and picture of every frame (safetensors, 2.2 MB/s at 16x16); '-': a line "
              "of JSON for each on stdout")
      .writes()
      .option("mcap", "FILE",
              "keep taxels and pictures as ROS 2 messages in an MCAP file, which Foxglove, Rerun, "
              "PlotJuggler and ros2 bag open")
      .writes()
      .option("map", "FILE",
              "keep the surface that was felt, as far as the finger's places are known: .png, .safetensors, "
              ".csv (its elements) or .stl (docs/map.md)")
      .writes()
      .only_with("map")
      .option("elements", "KIND",
              "where the map shows an element, draw one of this kind: bumps, ridges, blobs, any (the one "
              "of these that it resembles most), or an STL file of a plate with one element in its middle")
      .only_with("")
      .option("record", "DIR", "keep the signals as a recording in this folder, the next pass of its plate")
      .only_with("record")
      .option("plate", "NAME", "what the recording slides over: a plate's name, or an STL file", "unknown")
      .only_with("board")
      .option("capture", "JOURNAL", "keep the board's raw bytes (185 kB/s), for --replay")
      .writes()
      .only_with("")
      .option("precision", "NAME",
              "fp32, or int8: the pictures of a microcontroller (supertac-export --c99), slower", "fp32")
      .option("speedup", "X", "of a virtual rig started with the same --speedup", "1")
      .flag("probe",
            "listen to --sensor FILE, or to an address such as serial:/dev/ttyACM0@115200, udp::PORT, "
            "tcp:HOST:PORT, for --seconds (5), say what comes, and write a sensor's file to --out; with "
            "--web the array is shown then: press a taxel, and see which one lights up; pressing all of "
            "them in turn writes the file's order")
      .only_with("probe")
      .flag("gain",
            "with --probe: find the gain of each taxel as well, which you press about equally hard (30 s)")
      .only_with("");
  declare_web(a);
}

/// Whether it names a sensor's file, whatever its ending, and no address: a file is one as well where a
/// sensor's bytes were kept, which are not one object.
bool describes_sensor(const std::string& named) {
  if (named == "rig" || named.ends_with(".json")) return true;
  std::error_code error;
  if (!std::filesystem::is_regular_file(named, error) || std::filesystem::file_size(named, error) > 1U << 20)
    return false;
  try {
    return parse_json_limited(read_text_file(named, 1U << 20)).is_object();
  } catch (const JsonError&) {
    return false;
  }
}

/// Says what a port sends and keeps the draft; --sensor names a sensor's file, or an address alone.
ProbeReport probe_port(const Arguments& a) {
  if (!a.given("sensor"))
    throw UsageError("--probe: expected --sensor with a file or an address, found none");
  const std::string& named = a.text("sensor");
  const bool described = describes_sensor(named);
  Sensor sensor;
  if (described) sensor = read_sensor(named);
  if (!described) sensor.port = named;
  const bool gain = a.flag("gain");
  const double seconds = a.given("seconds") ? a.number("seconds", 0.1, 3600) : gain ? 30 : 5;
  const OpenedPort opened = open_port(sensor.port);
  a.note("listening for " + format(seconds) +
         (gain ? " s: press every taxel equally hard, many at once with something flat, and let go"
               : " s: press here and there, and let go"));
  const std::vector<Heard> heard = listen(opened, sensor.port, seconds, interrupted);
  const auto known = described ? std::optional(sensor) : std::nullopt;
  ProbeReport report = gain && known ? ProbeReport{{}, known} : probe(heard, sensor.port, known);
  if (gain && report.draft) {
    ProbeReport found = find_gain(heard, *report.draft);
    report.says.insert(report.says.end(), found.says.begin(), found.says.end());
    report.draft = std::move(found.draft);
  }
  for (const std::string& line : report.says) a.print(line);
  if (!report.draft)
    throw std::runtime_error(sensor.port +
                             (gain ? ": no gains were found" : ": no frames of a sensor were found"));
  if (a.given("out")) {
    write_sensor(a.output("out"), *report.draft);
  } else {
    a.print(json_of(*report.draft).dump(2));
  }
  return report;
}

/// Taxels that the probe took for dead are shown as they are: pressing one says whether it is.
std::unique_ptr<SensorSource> open_draft(const Arguments& a, Sensor draft, double speedup) {
  const std::string& named = a.text("sensor");
  draft.dead = describes_sensor(named) ? read_sensor(named).dead : std::vector<int>();
  return open_sensor(draft, speedup);
}

int run(Arguments& a) {
  std::optional<ProbeReport> probed;
  nlohmann::ordered_json result;
  if (a.flag("probe")) {
    probed = probe_port(a);
    result = {{"says", probed->says}, {"draft", json_of(*probed->draft)}};
  }
  if (probed && !a.given("web")) {
    a.write_json(result);
    return kExitOk;
  }
  const double begin = monotonic_seconds();
  const double speedup = a.number("speedup", 0.1, 100);
  StreamSettings settings{.out = probed ? "" : a.output("out"),
                          .mcap = a.output("mcap"),
                          .record = a.text("record"),
                          .plate = a.text("plate"),
                          .map = a.output("map"),
                          .view = !a.quiet() && drawable_terminal()};
  if (probed)
    settings.found = probed->says, settings.draft = probed->draft, settings.draft_file = a.text("out");
  if (a.given("seconds") && !probed) settings.seconds = a.number("seconds", 0.001, 1e9);
  const std::string option = source_option(a), origin = option + " " + a.text(option);
  if (a.given("elements"))
    settings.elements = read_option("elements", [&] { return kinds_of_elements(a.text("elements")); });
  settings.web = web_address(a);
  settings.badge = badge_of(option, a.text(option)), settings.source = origin;
  const bool drawn = a.given("model");
  settings.metadata = {{"kind", "pictures"}, {"model", a.text("model")}, {"source", origin}};
  std::vector<ModelFile> models;
  if (drawn) models = load_models(a.list("model"));
  settings.precision = precision_of(a.choice("precision", {"fp32", "int8"}));
  if (drawn) add_model_parents(a.list("model"));
  const auto source = probed ? open_draft(a, *probed->draft, speedup) : open_source(a, speedup);
  Stream stream(settings, models, *source);
  const double ready_ms = 1e3 * (monotonic_seconds() - begin);
  a.note(
      "ready: " + origin +
      (drawn ? "; a picture needs " + format(stream.window_s(), 2) + " s of signal" : "; the array itself"));
  if (!stream.url().empty()) a.note("live page: " + stream.url());
  std::exception_ptr error;
  std::string failure;
  try {
    stream.run();
  } catch (const std::exception& thrown) {
    error = std::current_exception();  // what was seen before is kept
    failure = thrown.what();
  }
  stream.finish(failure);
  if (settings.out.path == "-")
    a.note(stream.summary());
  else
    a.print(stream.summary());
  result.update({{"source", origin},
                 {"model", a.text("model")},
                 {"precision", name_of(settings.precision)},
                 {"ready_ms", ready_ms}});
  result.update(stream.result());
  a.write_json(result);
  if (error) std::rethrow_exception(error);
  if (stream.pictures() == 0 && !interrupted() && !drawn)
    throw std::runtime_error(origin + ": no frame came; supertac-stream --probe says what does");
  if (stream.pictures() == 0 && !interrupted()) {
    throw std::runtime_error(
        origin + ": no picture, expected " + format(stream.window_s(), 2) + " s of signal without a gap of " +
        format(longest_silence_s(source->period_s()), 2) + " s, found " + std::to_string(stream.gaps()) +
        (stream.gaps() > 0 ? " gaps" + stream.rate_remark() : " gaps; stream for longer"));
  }
  return kExitOk;
}

}  // namespace supertac
