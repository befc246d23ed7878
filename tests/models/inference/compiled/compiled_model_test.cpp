#include "models/inference/compiled/compiled_model.h"

#include <omp.h>

#include "autograd/kernels/fast/isa/isa.h"
#include "io/files/safetensors.h"
#include "tests/allocations.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::compiled_model_test {

using kernels::isa_kernels;
using kernels::supported_sets;
using kernels::use_isa;

void expect_close(const Tensor& a, const Tensor& b, const std::string& what) {
  ASSERT_EQ(a.defined(), b.defined()) << what;
  if (!a.defined()) return;
  ASSERT_EQ(a.shape(), b.shape()) << what;
  double largest = 0, difference = 0;
  for (Dim i = 0; i < a.size(); ++i) {
    largest = std::max(largest, static_cast<double>(std::abs(a.data()[i])));
    difference = std::max(difference, static_cast<double>(std::abs(a.data()[i] - b.data()[i])));
  }
  EXPECT_LE(difference, 1e-5 * std::max(1.0, largest)) << what;
}

void expect_same_estimate(const SuperTac& network, Dim count, const std::string& what) {
  const Tensor inputs = uniform(network.input_shape(count), 7);
  const Estimate forward = network.estimate(inputs), compiled = CompiledModel(network).estimate(inputs);
  expect_close(forward.picture, compiled.picture, what + " picture");
  expect_close(forward.predicted_error, compiled.predicted_error, what + " predicted_error");
  expect_close(forward.latents, compiled.latents, what + " latents");
}

SuperTacSettings random_settings(std::uint64_t seed) {
  Draws draw(seed, 0);
  SuperTacSettings s;
  s.rows = draw.of({2, 3, 4, 5, 8});
  s.columns = draw.of({4, 5, 6, 10});
  s.in_channels = draw.of({1, 1, 2, 3});
  s.timesteps = draw.of({32, 48, 64});
  s.latent = draw.of({1, 3, 10});
  s.scale = draw.of({4, 4, 8});
  s.channels = draw.of({4, 8, 12, 16, 20, 32});
  s.rcabs = draw.of({0, 1, 2});
  s.grouping = draw.of({Grouping::horizontal, Grouping::vertical});
  s.predicted_error = draw.of({true, false});
  s.last_frame_path = draw.of({true, false});
  return s;
}

TEST(CompiledModel, DrawsWhatTheNetworkDrawsForPresetsAndAnySettings) {
  for (const char* preset : {"paper", "tiny", "frame"})
    expect_same_estimate(random_network(SuperTacSettings::of_preset(preset)), 9, preset);
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const SuperTacSettings s = random_settings(seed);
    expect_same_estimate(random_network(s, seed), 1 + static_cast<Dim>(seed % 10),
                         "seed " + std::to_string(seed) + ": " + std::to_string(s.rows) + "x" +
                             std::to_string(s.columns) + " channels " + std::to_string(s.channels));
  }
}

// All pictures of 64 windows, `batch` at a time.
Tensor in_batches(const CompiledModel& network, const Tensor& windows, Dim batch) {
  Tensor all(network.network().picture_shape(windows.dim(0)));
  const Dim size = windows.size() / windows.dim(0), pixels = all.size() / windows.dim(0);
  for (Dim first = 0; first < windows.dim(0); first += batch) {
    const Dim count = std::min(batch, windows.dim(0) - first);
    const Tensor part = Tensor::of(network.network().input_shape(count),
                                   windows.values().subspan(static_cast<std::size_t>(first * size),
                                                            static_cast<std::size_t>(count * size)));
    const Estimate e = network.estimate(part);
    std::copy_n(e.picture.data(), e.picture.size(), all.data() + first * pixels);
  }
  return all;
}

CompiledModel prepare(const SuperTac& network, bool bytes) {
  if (!bytes) return CompiledModel(network);
  ActivationRanges ranges;
  ranges.add(network, uniform(network.input_shape(16), 5));
  return CompiledModel(network, ranges);
}

class CompiledBits : public testing::TestWithParam<std::tuple<const char*, bool>> {};

TEST_P(CompiledBits, AreOneForBatchesInstructionSetsAndThreads) {
  const auto [preset, bytes] = GetParam();
  const SuperTac network = random_network(SuperTacSettings::of_preset(preset), 3);
  const Tensor windows = uniform(network.input_shape(64), 1);
  const kernels::IsaKernels& before = isa_kernels();
  const Tensor expected = in_batches(prepare(network, bytes), windows, 64);
  for (const kernels::IsaKernels* set : supported_sets()) {
    if (set == &kernels::kPlainKernels || set == &kernels::kPortableKernels) continue;  // far slower
    use_isa(*set);
    const CompiledModel compiled = prepare(network, bytes);
    for (const Dim batch : {1, 7, 8, 64}) {
      for (const int threads : {1, 2, 4}) {
        omp_set_num_threads(threads);
        EXPECT_TRUE(std::ranges::equal(expected.values(), in_batches(compiled, windows, batch).values()))
            << preset << " " << set->name << ", batch " << batch << ", threads " << threads;
      }
    }
  }
  use_isa(before);
  omp_set_num_threads(1);
}

INSTANTIATE_TEST_SUITE_P(All, CompiledBits,
                         testing::Combine(testing::Values("paper", "tiny"), testing::Bool()));

TEST(CompiledModel, InBytesDrawsNearlyTheSame) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const SuperTac network = random_network(random_settings(seed), seed);
    const Tensor inputs = uniform(network.input_shape(9), 5);
    const Estimate exact = network.estimate(inputs), bytes = prepare(network, true).estimate(inputs);
    const auto [low, high] = std::ranges::minmax(exact.picture.values());
    for (Dim i = 0; i < exact.picture.size(); ++i)
      ASSERT_NEAR(exact.picture.data()[i], bytes.picture.data()[i], 0.1 * (high - low)) << "seed " << seed;
  }
}

TEST(CompiledModel, RefusesTheRangesOfAnotherNetworkAndInputsOfAnotherShape) {
  const SuperTac network = random_network();
  EXPECT_REFUSAL("CompiledModel: inputs expects [N,32,16], got [1,3,16]",
                 CompiledModel(network).estimate(Tensor::zeros({1, 3, 16})));
  EXPECT_EQ(CompiledModel(network).estimate(Tensor::zeros(network.input_shape(0))).picture.dim(0), 0);
  EXPECT_REFUSAL("CompiledModel: ranges expects those of the network's 46 ops, got 0",
                 CompiledModel(network, ActivationRanges()));
}

TEST(CompiledModel, RefusesRangesThatAreNotFiniteOrNoPairs) {
  const TemporaryFolder folder;
  const auto read = [&](float high) {
    const std::array<float, 4> ranges{0, 1, -1, high};  // write_checkpoint() would refuse the same itself
    write_safetensors(folder / "m.safetensors", {},
                      {{"int8.ranges", "F32", {2, 2}, std::as_bytes(std::span(ranges))}});
    return ActivationRanges::read(SafetensorsFile::read(folder / "m.safetensors"));
  };
  EXPECT_EQ(read(2)->ops(), 2U);
  const std::pair<float, const char*> refused[] = {
      {-1.0F, "-1"}, {std::numeric_limits<float>::infinity(), "inf"}, {std::nanf(""), "nan"}};
  for (const auto& [high, found] : refused)
    EXPECT_EQ(
        what_of<std::runtime_error>([&, &high = high] { read(high); }),
        folder / "m.safetensors" + ": int8.ranges expected finite ranges around 0, found -1 to " + found);
  write_checkpoint(folder / "flat.safetensors", {}, {}, {{"int8.ranges", {4}, {0, 1, -1, 2}}});
  EXPECT_EQ(what_of<std::runtime_error>(
                [&] { ActivationRanges::read(SafetensorsFile::read(folder / "flat.safetensors")); }),
            folder / "flat.safetensors" + ": int8.ranges expected F32 [N,2], found F32 [4]");
}

// A warm training step and a warm inference, compiled or not, go to the heap not once.
long allocations_of_five(const std::function<void()>& warm) {
  for (int i = 0; i < 3; ++i) warm();
  const long before = allocations::made;
  for (int i = 0; i < 5; ++i) warm();
  return allocations::made - before;
}

TEST(NoAllocation, WarmTrainingStep) {
  SmallTraining small;
  small.recipe.augment = kStandardAugmentation;
  Trainer trainer = small.trainer();
  EXPECT_EQ(allocations_of_five([&] { trainer.train_step(); }), 0);
}

TEST(NoAllocation, WarmInference) {
  const SuperTac network = random_network(SuperTacSettings::of_preset("paper"));
  const CompiledModel compiled(network);
  const Tensor one = uniform(network.input_shape(1), 1), many = uniform(network.input_shape(9), 1);
  EXPECT_EQ(allocations_of_five([&] { network.infer(one); }), 0);
  EXPECT_EQ(allocations_of_five([&] { compiled.estimate(one), compiled.estimate(many); }), 0);
  const Ensemble both({compiled, compiled});
  EXPECT_EQ(allocations_of_five([&] { both.estimate(one); }), 0);
  EXPECT_TRUE(both.estimate(one).predicted_error.defined());
}

// Where members differ, the ensemble is less sure than any of them.
TEST(Ensemble, AveragesPicturesAndAddsTheirVarianceToPredictedErrors) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  SuperTacSettings settings = small_settings();
  for (const bool predicts : {false, true}) {
    settings.predicted_error = predicts;
    for (std::uint64_t m = 0; m < 2; ++m) save_model(paths[m], random_network(settings, m + 1), {}, {});
    const std::vector<ModelFile> files = load_models(paths);
    const Estimate a = CompiledModel(*files[0].model).estimate(windows),
                   b = CompiledModel(*files[1].model).estimate(windows),
                   both = ensemble_of(files).estimate(windows);
    EXPECT_TRUE(std::ranges::equal(Ensemble({CompiledModel(*files[0].model)}).infer(windows).values(),
                                   a.picture.values()));
    ASSERT_EQ(both.picture.shape(), a.picture.shape());
    ASSERT_EQ(both.predicted_error.defined(), predicts);
    double difference = 0;
    for (std::size_t i = 0; i < a.picture.values().size(); ++i) {
      EXPECT_FLOAT_EQ(both.picture.values()[i], (a.picture.values()[i] + b.picture.values()[i]) / 2);
      const double half = (a.picture.values()[i] - b.picture.values()[i]) / 2;
      difference += std::abs(half);
      if (!predicts) continue;
      const double squares =
          (std::pow(a.predicted_error.values()[i], 2) + std::pow(b.predicted_error.values()[i], 2)) / 2;
      EXPECT_NEAR(both.predicted_error.values()[i], std::sqrt(squares + half * half), 1e-5);
    }
    EXPECT_GT(difference, 0) << "the two seeds draw the same, so nothing was averaged";
  }
}

void expect_refused(const std::vector<std::string>& paths, const std::string& why) {
  EXPECT_ERROR(load_models(paths), std::runtime_error, why);
}

TEST(Ensemble, SaysWhichModelsDoNotBelongTogether) {
  const TemporaryFolder folder;
  const auto saved = [&](const char* name, const SuperTacSettings& settings, double rate_hz = 300,
                         const std::map<std::string, std::string>& metadata = {}) {
    save_model(folder / name, random_network(settings), {.rate_hz = rate_hz, .scaling = {}}, metadata);
    return folder / name;
  };
  const SuperTacSettings small = small_settings();
  SuperTacSettings larger = small, unsure = small, fine = small;
  larger.latent = 5, unsure.predicted_error = true, fine.scale = 4;
  const std::string one = saved("a.safetensors", small);
  EXPECT_EQ(load_models(std::vector{one, saved("larger.safetensors", larger)}).size(), 2U)
      << "their size does not matter";
  EXPECT_EQ(load_models(std::vector{one, saved("random.safetensors", small, 300, {{"random_plates", "100"}})})
                .size(),
            2U)
      << "what they were trained on does not matter";
  expect_refused({one, saved("unsure.safetensors", unsure)}, "unsure.safetensors: its settings are");
  expect_refused({one, saved("fine.safetensors", fine)}, "fine.safetensors: its settings are");
  expect_refused({one, saved("slow.safetensors", small, 100)}, "slow.safetensors: its input are");
}

TEST(Ensemble, RefusesNoNetworkAndThoseOfOtherInputs) {
  EXPECT_REFUSAL("Ensemble: members expects one network or more, got none", Ensemble({}));
  SuperTacSettings twice_as_long = small_settings();
  twice_as_long.timesteps = 64;
  EXPECT_REFUSAL(
      "Ensemble: members expects networks of one format, 32 frame(s) of 4x4 taxels with 1 channel(s) and "
      "pictures of 8x8, got 64 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 8x8",
      Ensemble({CompiledModel(random_network()), CompiledModel(random_network(twice_as_long))}));
}

}  // namespace supertac::compiled_model_test
