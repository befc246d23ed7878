// supertac-export: a model in the form of other runtimes.

#include "apps/common/command_line/program.h"
#include "io/files/file.h"
#include "models/files/onnx.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments.positional("MODEL", "a model that supertac-train wrote, for recordings or for pairs")
      .required("onnx", "FILE", "the network as ONNX: volts in, picture out, scaling and normalisation inside");
}

int run(Arguments& arguments) {
  const std::string path = arguments.text("onnx");
  const std::string model = arguments.text("MODEL");
  const bool frames = SafetensorsFile::read(model).metadata().contains("kind");
  const ModelFile file = load_model(model, frames ? ModelKind::frames : ModelKind::windows);
  const std::string bytes = onnx_of(file);
  write_file(arguments.output("onnx"), bytes);
  const NetworkFormat f = file.network().format();
  const auto text = [](Dim size) { return std::to_string(size); };
  const std::string input =
      frames ? "frames [N," + text(f.channels) + "," + text(f.rows) + "," + text(f.columns) + "]"
             : "volts [N," + text(f.frames) + "," + text(f.rows * f.columns * f.channels) + "]";
  const std::string output = "picture [N," + text(f.rows * f.scale) + "," + text(f.columns * f.scale) + "]";
  arguments.print(path + ": " + input + " -> " + output + ", " + std::to_string(bytes.size()) + " bytes");
  arguments.write_json({{"file", path}, {"input", input}, {"output", output}, {"bytes", bytes.size()}});
  return kExitOk;
}

}  // namespace supertac
