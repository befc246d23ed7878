// supertac-export: a model in the form of other runtimes.

#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "io/files/file.h"
#include "models/files/exports.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments.positional("FILE", "a model that supertac-train wrote")
      .option("onnx", "FILE", "the network as ONNX: volts in, picture out, scaling and normalisation inside")
      .writes()
      .option("c99", "DIR",
              "the int8 network as C99 for microcontrollers, with all that stands before it when it is live: "
              "NAME.h and NAME.c")
      .writes()
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

}  // namespace

int run(Arguments& arguments) {
  if (arguments.given("onnx") == arguments.given("c99"))
    throw UsageError("expected one of --onnx FILE and --c99 DIR, found " +
                     std::string(arguments.given("c99") ? "both" : "none"));
  const SafetensorsFile file = SafetensorsFile::read(arguments.text("FILE"));
  return arguments.given("c99") ? export_c(arguments, file) : export_onnx(arguments, model_of(file));
}

}  // namespace supertac
