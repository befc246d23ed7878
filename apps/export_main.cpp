// supertac-export: a model in the form of other runtimes.

#include <filesystem>

#include "apps/common/command_line/program.h"
#include "apps/common/command_line/version.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/output/provenance.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "models/files/c_code.h"
#include "models/files/onnx.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments.positional("MODEL", "a model that supertac-train wrote; for pairs with --onnx alone")
      .option("onnx", "FILE", "the network as ONNX: volts in, picture out, scaling and normalisation inside")
      .option("c99", "DIR",
              "the int8 network as C99 for microcontrollers, with all that stands before it when it is live: "
              "NAME.h and NAME.c")
      .one_of("onnx", "c99")
      .only_with("c99")
      .option("name", "NAME", "of the C files and functions", "finger")
      .option("sensor-hz", "HZ", "frames a second that the device reads (default: the model's rate)")
      .only_with("");
}

static int export_onnx(Arguments& arguments, const ModelFile& file) {
  const std::string path = arguments.text("onnx");
  const std::string bytes = onnx_of(file);
  write_file(arguments.output("onnx"), bytes);
  const NetworkFormat f = file.network().format();
  const auto text = [](Dim size) { return std::to_string(size); };
  const std::string input =
      file.frame_model ? "frames [N," + text(f.channels) + "," + text(f.rows) + "," + text(f.columns) + "]"
                       : "volts [N," + text(f.frames) + "," + text(f.rows * f.columns * f.channels) + "]";
  const std::string output = "picture [N," + text(f.rows * f.scale) + "," + text(f.columns * f.scale) + "]";
  arguments.print(path + ": " + input + " -> " + output + ", " + std::to_string(bytes.size()) + " bytes");
  arguments.write_json({{"file", path}, {"input", input}, {"output", output}, {"bytes", bytes.size()}});
  return kExitOk;
}

static int export_c(Arguments& arguments, const ModelFile& file) {
  const std::string model = arguments.text("MODEL"), name = arguments.text("name");
  const double hz = arguments.given("sensor-hz") ? arguments.number("sensor-hz", 1, 100'000) : 0;
  const CCode code = read_option("name", [&] {
    return c_code_of(file, name, hz > 0 ? hz : file.input.rate_hz,
                     "supertac-export of " + std::filesystem::path(model).filename().string() + " (SHA-256 " +
                         hash_of_file(model).substr(0, 16) + ")");
  });
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

int run(Arguments& arguments) {
  const std::string model = arguments.text("MODEL");
  const bool frames = SafetensorsFile::read(model).metadata().contains("kind");
  const ModelFile file = load_model(model, frames ? ModelKind::frames : ModelKind::windows);
  return arguments.given("c99") ? export_c(arguments, file) : export_onnx(arguments, file);
}

}  // namespace supertac
