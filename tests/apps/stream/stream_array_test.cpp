// supertac-stream with another array than the rig's.
#include "data/recordings/simulator.h"
#include "io/files/safetensors.h"
#include "models/files/model_file.h"
#include "tests/apps/common/expect.h"

namespace supertac {
namespace {

class Stream : public ProgramTest {};

TEST_F(Stream, AModelOfAnotherArrayTakesItsRecordingsOnly) {
  const TaxelArray array{.rows = 2, .columns = 6, .pitch_mm = 2};
  SuperTacSettings settings{.timesteps = 32, .latent = 3, .channels = 8, .rcabs = 1};
  set_array(settings, array);
  Rng rng(1);
  const std::string model = path("m.safetensors"), out = path("o.safetensors");
  save_model(model, SuperTac(settings, rng), {.scaling = {}, .filter_s = 0.0992, .pitch_mm = array.pitch_mm},
             {});
  write_recording(path("own.safetensors"), simulate_pass(Plate::named("bumps12"), {}, {.array = array}));
  write_recording(path("rig.safetensors"), simulate_pass(Plate::named("bumps12"), {}));
  succeed("supertac-stream --recording own.safetensors --model " + model + " --seconds 1 --out " + out);
  const SafetensorsFile file = SafetensorsFile::read(out);
  const std::uint64_t count = file.tensors().at("time_s").shape[0];
  EXPECT_EQ(file.tensors().at("volts").shape, (std::vector<std::uint64_t>{count, 12}));
  EXPECT_EQ(file.tensors().at("pictures").shape, (std::vector<std::uint64_t>{count, 8, 24}));
  const auto rig = run("supertac-stream --recording rig.safetensors --model " + model);
  EXPECT_EQ(rig.code, 1);
  EXPECT_EQ(
      rig.error.substr(rig.error.find("the signals")),
      "the signals are those of 4x4 taxels at 3 mm, the model was trained on 2x6 taxels at 2 mm; choose "
      "signals and model of one array (supertac-info tells)\n");
}

}  // namespace
}  // namespace supertac
