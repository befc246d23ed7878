#include <utility>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "data/simulation/simulator.h"
#include "io/numbers/hash.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

using Bits = std::vector<std::pair<std::string, std::string>>;  // what, and its hash

// What every processor has to give.
const Bits kGolden{{"recording", "8fc820b03f1fd35f"},
                   {"training", "595c9f44eef11d0b"},
                   {"pictures", "d00f8aab28581d56"},
                   {"int8", "1ade74d4c58351ce"}};

template <class... Arrays>
std::string hash_of(const Arrays&... arrays) {
  Sha256 sum;
  (sum.add(std::as_bytes(std::span(arrays))), ...);
  return sum.hex().substr(0, 16);
}

// A pass, ten steps of training on its windows, and pictures of the network that comes out.
Bits bits_here() {
  const Recording pass = simulate_pass(Plate::named("ridges6"), {.from_mm = 20, .to_mm = 45});
  WindowSet windows(
      {.timesteps = 32, .scale = 4, .rate_hz = 100, .scaling = {.per_window = true}, .stride = 4});
  windows.add(pass, ".");
  Recipe settings;
  settings.model = SuperTacSettings::of_preset("tiny");
  settings.model.timesteps = 32;
  settings.epochs = 100;
  settings.batch = 32;
  settings.augment = kStandardAugmentation;
  std::vector<std::uint32_t> all(windows.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  Trainer trainer(windows, all, settings);
  for (int step = 0; step < 10; ++step) trainer.train_step();
  Sha256 training;
  trainer.for_each_tensor(
      [&](const std::string&, const Tensor& of) { training.add(std::as_bytes(of.values())); });

  constexpr Dim kPictures = 12;
  Tensor inputs(trainer.model().input_shape(kPictures));
  const std::size_t size = inputs.values().size() / kPictures;
  for (std::size_t i = 0; i < kPictures; ++i)
    windows.window(i * (windows.size() - 1) / (kPictures - 1), inputs.values().subspan(i * size, size));
  ActivationRanges ranges;
  ranges.add(trainer.model(), inputs);
  const Tensor pictures = CompiledModel(trainer.model()).estimate(inputs).picture,
               coarse = CompiledModel(trainer.model(), ranges).estimate(inputs).picture;
  return {{"recording", hash_of(pass.signals, pass.time_s)},
          {"training", training.hex().substr(0, 16)},
          {"pictures", hash_of(pictures.values())},
          {"int8", hash_of(coarse.values())}};
}

}  // namespace

int check_bits(const Arguments& a) {
  Json rows = Json::array();
  std::size_t wrong = 0;
  for (const kernels::IsaKernels* set : kernels::supported_sets()) {
    if (set == &kernels::kPlainKernels) continue;  // sums in another order: right up to rounding only
    kernels::use_isa(*set);
    const Bits found = bits_here();
    const bool fma = set != &kernels::kPortableKernels && set->name == kernels::kPortableKernels.name;
    Json row = {{"kernels", std::string(set->name) + (fma ? ", with fma" : "")}};
    std::string line;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto& [what, hash] = found[i];
      const bool same = hash == kGolden[i].second;
      wrong += !same;
      row[what] = hash;
      line += "  " + what + " " + hash + (same ? " ok" : " expected " + kGolden[i].second);
    }
    a.print(row["kernels"].get<std::string>() + ":" + line);
    rows.push_back(std::move(row));
  }
  a.print(wrong == 0
              ? "the same bits on every path"
              : std::to_string(wrong) +
                    " hashes differ: another version, or this processor or compiler computes otherwise");
  a.write_json({{"paths", rows}, {"wrong", wrong}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

}  // namespace supertac
