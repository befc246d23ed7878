// supertac-export: a model in the form of other runtimes, a recording or pictures in that of other tools.

#include <algorithm>
#include <cmath>

#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "data/recordings/mcap_log.h"
#include "data/recordings/recording.h"
#include "data/recordings/signals_tensor.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "models/files/chain.h"
#include "models/files/onnx.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments
      .positional(
          "FILE",
          "a model that supertac-train wrote; with --mcap a recording, or pictures of supertac-stream "
          "--out")
      .option("onnx", "FILE", "the network as ONNX: volts in, picture out, scaling and normalisation inside")
      .writes()
      .option("c99", "DIR",
              "the int8 network as C99 for microcontrollers, with all that stands before it when it is live: "
              "NAME.h and NAME.c")
      .writes()
      .option("mcap", "FILE",
              "frames and pictures as ROS 2 messages, which Foxglove, Rerun, PlotJuggler and ros2 bag open")
      .writes()
      .one_of({"onnx", "c99", "mcap"})
      .only_with("c99")
      .option("name", "NAME", "of the C files and functions", "finger")
      .option("sensor-hz", "HZ", "frames a second that the device reads (default: the model's rate)")
      .only_with("");
}

namespace {

int export_onnx(Arguments& arguments, const ModelFile& file) {
  const std::string path = arguments.text("onnx");
  const std::string bytes = onnx_of(file);
  write_file(arguments.output("onnx"), bytes);
  const SuperTacSettings& s = file.model->settings();
  const auto text = [](Dim size) { return std::to_string(size); };
  const std::string input = "volts [N," + text(s.timesteps) + "," + text(s.signals()) + "]";
  const std::string output = "picture [N," + text(s.image_height()) + "," + text(s.image_width()) + "]";
  arguments.print(path + ": " + input + " -> " + output + ", " + std::to_string(bytes.size()) + " bytes");
  arguments.write_json({{"file", path}, {"input", input}, {"output", output}, {"bytes", bytes.size()}});
  return kExitOk;
}

int export_c(Arguments& arguments, const SafetensorsFile& file) {
  const std::string name = arguments.text("name");
  const double hz = arguments.given("sensor-hz") ? arguments.number("sensor-hz", 1, 100'000) : 0;
  const CCode code = read_option("name", [&] { return exported(file, name, hz); });
  OutputFolder folder(arguments.output("c99"));
  const std::string header = folder.add(name + ".h"), source = folder.add(name + ".c");
  write_file(header, code.header);
  write_file(source, code.source);
  folder.keep();
  arguments.print(arguments.text("c99") + "/" + name + ".c: " + std::to_string(code.weight_bytes) +
                  " bytes of weights, " + std::to_string(code.work_bytes) + " of work area");
  arguments.write_json({{"folder", arguments.text("c99")},
                        {"name", name},
                        {"weight_bytes", code.weight_bytes},
                        {"work_bytes", code.work_bytes}});
  return kExitOk;
}

// A recording, or pictures: what PictureLog writes, which has a recording's frames and "began_s".
int export_mcap(Arguments& arguments, const SafetensorsFile& file) {
  const bool drawn = value_or(file.metadata(), "kind") == "pictures";
  if (!drawn) recording_of(file);  // checks it
  const TaxelArray array = array_of(file);
  const std::vector<double> times = file.f64("time_s");
  const std::size_t n = times.size(), signals = array.signals();
  const auto values = [&](const char* name, std::vector<std::uint64_t> shape) {
    if (file.tensors().contains(name) && file.tensors().at(name).shape != shape)
      throw FileError(file.path(),
                      std::string("tensor ") + name + " does not fit the others; stream it again");
    return file.f32(name);
  };
  const std::vector<float> volts = values(signals_tensor(file), {n, signals});
  std::vector<float> pictures, half_widths;
  ImageGrid image{0, 0};
  if (drawn && file.tensors().contains("pictures")) {
    const auto& shape = file.tensors().at("pictures").shape;
    const std::uint64_t scale = shape.size() == 3 ? shape[1] / static_cast<std::uint64_t>(array.rows) : 0;
    if (scale < 1 || scale > 64)
      throw FileError(file.path(), "pictures are not of its array; stream it again");
    image = array.picture(static_cast<int>(scale));
    const std::vector<std::uint64_t> expected{n, static_cast<std::uint64_t>(image.height),
                                              static_cast<std::uint64_t>(image.width)};
    pictures = values("pictures", expected);
    if (file.tensors().contains("half_widths")) half_widths = values("half_widths", expected);
  }
  if (!std::ranges::all_of(times, [](double t) { return std::isfinite(t); }))
    throw FileError(file.path(), "a time is not finite; stream it again");
  const double began_s = parse_double(value_or(file.metadata(), "began_s")).value_or(NAN);
  McapLog log(arguments.output("mcap"), array, signal_scale_of(file), image, !half_widths.empty());
  const auto part = [](const std::vector<float>& of, std::size_t i, std::size_t size) {
    return of.empty() ? std::span<const float>{} : std::span(of).subspan(i * size, size);
  };
  const double begin_s = drawn || n == 0 ? 0 : times[0];  // of the stream's first frame
  for (std::size_t i = 0; i < n; ++i)
    log.add(times[i] - begin_s, began_s + times[i], part(volts, i, signals),
            part(pictures, i, image.pixels()), part(half_widths, i, image.pixels()));
  log.close();
  const std::string path = arguments.text("mcap");
  arguments.print(path + ": " + std::to_string(n) + (pictures.empty() ? " frames" : " pictures"));
  arguments.write_json({{"file", path}, {"frames", n}, {"pictures", !pictures.empty()}});
  return kExitOk;
}

}  // namespace

int run(Arguments& arguments) {
  const SafetensorsFile file = SafetensorsFile::read(arguments.text("FILE"));
  if (arguments.given("mcap")) return export_mcap(arguments, file);
  return arguments.given("c99") ? export_c(arguments, file) : export_onnx(arguments, model_of(file));
}

}  // namespace supertac
