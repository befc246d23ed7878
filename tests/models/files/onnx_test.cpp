#include "data/windows/transforms.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "models/files/exports.h"
#include "models/inference/compiled/compiled_model.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::onnx_test {

constexpr Dim kWindows = 1000;

ModelFile onnx_model_of(const std::string& preset, const TaxelArray& array, Grouping grouping,
                        bool last_frame = false) {
  SuperTacSettings settings = SuperTacSettings::of_preset(preset);
  set_array(settings, array);
  settings.grouping = grouping;
  settings.last_frame_path = last_frame;
  ModelFile file;
  file.model = std::make_unique<SuperTac>(random_network(settings, 7));
  file.input.scaling.per_window = true;
  file.metadata = model_metadata(settings, file.input);
  return file;
}

// Fingers that press, each window as hard and as long as chance will have it; some are pressed all the time.
Tensor volts_of(const SuperTac& network, Dim count) {
  Tensor volts(network.input_shape(count));
  Draws draw(11, 3);
  const Dim frames = volts.dim(1), signals = volts.dim(2);
  for (Dim n = 0; n < count; ++n) {
    for (Dim k = 0; k < signals; ++k) {
      const double rest = 0.1 * draw(), depth = 0.4 * draw(), phase = 6 * draw(), speed = 0.1 * draw();
      for (Dim t = 0; t < frames; ++t) {
        const double press = rest + depth * std::max(0.0, std::sin(phase + speed * static_cast<double>(t)));
        volts.data()[(n * frames + t) * signals + k] = static_cast<real>(2.45 - press + 0.01 * draw.normal());
      }
    }
  }
  return volts;
}

void write_case(const TemporaryFolder& folder, const std::string& name, const ModelFile& file, Dim count) {
  const Tensor volts = volts_of(*file.model, count);
  Tensor windows = volts.clone();
  file.input.scaling(windows.values());
  const auto size = static_cast<std::size_t>(windows.dim(1) * windows.dim(2));
  for (Dim n = 0; n < count && file.input.scaling.per_window; ++n)
    normalise_window(windows.values().subspan(static_cast<std::size_t>(n) * size, size),
                     static_cast<std::size_t>(windows.dim(2)));
  const Estimate drawn = CompiledModel(*file.model).estimate(windows);
  const auto array = [](const std::string& called, const Tensor& t) {
    TensorToWrite out{called, "F32", {}, std::as_bytes(std::span<const real>(t.values()))};
    for (int i = 0; i < std::min(t.rank(), 3); ++i) out.shape.push_back(static_cast<std::uint64_t>(t.dim(i)));
    return out;
  };
  std::vector<TensorToWrite> tensors = {array("volts", volts), array("picture", drawn.picture)};
  if (drawn.predicted_error.defined()) tensors.push_back(array("predicted_error", drawn.predicted_error));
  write_safetensors(folder.file(name + ".safetensors"), {}, tensors);
  write_file(folder.file(name + ".onnx"), onnx_of(file));
}

TEST(Onnx, OnnxruntimeDrawsOurPictures) {
  const TemporaryFolder folder;
  const TaxelArray rig, other{3, 5, 2.5, 2};
  for (const char* preset : {"tiny", "paper"}) {
    const std::string name(preset);
    write_case(folder, name + "_4x4", onnx_model_of(name, rig, Grouping::horizontal), kWindows);
    write_case(folder, name + "_3x5x2", onnx_model_of(name, other, Grouping::vertical), kWindows);
  }
  write_case(folder, "last_frame", onnx_model_of("tiny", other, Grouping::vertical, true), 50);
  ModelFile plain = onnx_model_of("tiny", rig, Grouping::horizontal);
  plain.input.scaling.per_window = false;
  write_case(folder, "not_normalised", plain, 50);
  ModelFile frames = onnx_model_of("frame", {6, 7, 2.5, 2}, Grouping::horizontal);
  frames.input.scaling.per_window = false;
  write_case(folder, "single_frames", frames, 50);
  const char* python = std::getenv("SUPERTAC_PYTHON");
  const std::string log = folder.file("log");
  const std::string command = std::string(python == nullptr ? "python3" : python) +
                              " " SUPERTAC_CHECK_ONNX " " + folder.path() + " >" + log + " 2>&1";
  const int status = std::system(command.c_str());
  const std::string said = read_text_file(log, 1 << 20);
  if (WEXITSTATUS(status) == 77 || WEXITSTATUS(status) == 127) GTEST_SKIP() << said;
  EXPECT_EQ(status, 0) << said;
  std::fputs(said.c_str(), stdout);
}

// Where onnxruntime is not installed this tells that the graph was changed since it was last compared.
TEST(Onnx, TheGraphIsTheOneThatWasCompared) {
  const std::string bytes = onnx_of(onnx_model_of("tiny", {}, Grouping::horizontal));
  EXPECT_EQ(bytes.find("TopK"), std::string::npos) << "pnnx drops its second output, and fails";
  Hash hash;
  hash.add(bytes);
  EXPECT_EQ(hash.hex(), "85e4f92e4e42cca0")
      << "compare again: SUPERTAC_PYTHON=... models_test --gtest_filter=Onnx.*";
}

}  // namespace supertac::onnx_test
