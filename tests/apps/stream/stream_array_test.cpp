// supertac-stream with another array than the rig's.
#include <gtest/gtest.h>

#include "data/recordings/simulator.h"
#include "io/files/safetensors.h"
#include "models/files/model_file.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

TEST(Stream, AModelOfAnotherArrayTakesItsRecordingsOnly) {
  const TemporaryFolder folder;
  const TaxelArray array{.rows = 2, .columns = 6, .pitch_mm = 2};
  SuperTacSettings settings{.timesteps = 32, .latent = 3, .channels = 8, .rcabs = 1};
  set_array(settings, array);
  Rng rng(1);
  const std::string model = folder / "m.safetensors", out = folder / "o.safetensors";
  save_model(model, SuperTac(settings, rng), {.scaling = {}, .filter_s = 0.0992, .pitch_mm = array.pitch_mm},
             {});
  write_recording(folder / "own.safetensors", simulate_pass(Plate::named("bumps12"), {}, {.array = array}));
  write_recording(folder / "rig.safetensors", simulate_pass(Plate::named("bumps12"), {}));
  const auto own = run_process("supertac-stream", {"--recording", folder / "own.safetensors", "--model",
                                                   model, "--seconds", "1", "--out", out});
  EXPECT_EQ(own.code, 0) << own.error;
  const SafetensorsFile file = SafetensorsFile::read(out);
  const std::uint64_t count = file.tensors().at("time_s").shape[0];
  EXPECT_EQ(file.tensors().at("volts").shape, (std::vector<std::uint64_t>{count, 12}));
  EXPECT_EQ(file.tensors().at("pictures").shape, (std::vector<std::uint64_t>{count, 8, 24}));
  const auto rig =
      run_process("supertac-stream", {"--recording", folder / "rig.safetensors", "--model", model});
  EXPECT_EQ(rig.code, 1);
  EXPECT_EQ(
      rig.error.substr(rig.error.find("the signals")),
      "the signals are those of 4x4 taxels at 3 mm, the model was trained on 2x6 taxels at 2 mm; choose "
      "signals and model of one array (supertac-info tells)\n");
}

}  // namespace
}  // namespace supertac
