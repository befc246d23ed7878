#include "models/training/trainer.h"

#include <omp.h>

#include "autograd/kernels/fast/isa/isa.h"
#include "data/windows/transforms.h"
#include "io/files/json.h"
#include "io/numbers/hash.h"
#include "models/inference/evaluation.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::trainer_test {

TEST(Trainer, Learns) {
  SmallTraining small;
  small.recipe.epochs = 30;
  Trainer trainer = small.trainer();
  const double first = trainer.train_step().l2;
  double last = 0;
  while (!trainer.done()) last = trainer.train_step().l2;
  EXPECT_LT(last, first / 4);
  EXPECT_REFUSAL(
      "Trainer: train_step() expects a step of " + std::to_string(trainer.total_steps()) + " left, got none",
      trainer.train_step());
}

// Without noise the picture of the first step is that of inference.
TEST(Trainer, WithoutSamplingLatentsAreTheMeans) {
  SmallTraining small;
  small.recipe.loss.beta = 0;
  small.recipe.batch = static_cast<std::int64_t>(small.windows.size());
  const auto errors = [&](bool sampling) {
    small.recipe.sampling = sampling;
    Trainer trainer = small.trainer();
    const ZoneMetrics scores =
        score(Ensemble({CompiledModel(trainer.model())}), small.windows, all_of(small.windows));
    const double inferred = std::pow(10, -scores.all().psnr_pooled_db / 10);
    return std::abs(trainer.train_step().l2 - inferred) / inferred;
  };
  EXPECT_LT(errors(false), 1e-4);
  EXPECT_GT(errors(true), 1e-3);
  EXPECT_EQ(parse_json_limited(training_text(small.recipe))["beta"], 0.0);
}

// Deleting the augmentation, or another sample's, changes the loss; it is that of windows and truths changed
// by hand.
TEST(Trainer, LearnsFromAugmentedWindows) {
  SmallTraining small;
  const WindowSet& windows = small.windows;
  Recipe& settings = small.recipe;
  settings.augment = {.gain = 0.5, .noise = 0.05};
  settings.sampling = false;
  Trainer trainer = small.trainer();
  const Batching batching(all_of(windows), 8, settings.seed);
  std::vector<std::uint32_t> indices(8);
  batching.batch(0, indices);
  Batch by_hand{Tensor(trainer.model().input_shape(8)), Tensor(trainer.model().picture_shape(8)), {}};
  for (std::size_t n = 0; n < 8; ++n) {
    const auto window = by_hand.inputs.values().subspan(n * windows.input_size(), windows.input_size());
    windows.window(indices[n], window);
    augment(settings.augment, settings.seed, batching.sample(0, n), window);
    const auto truth = by_hand.targets.values().subspan(n * 64, 64);
    windows.truth(indices[n], truth);
  }
  std::array<Tensor, kGroups> no_noise;
  no_noise.fill(Tensor::zeros({8, settings.model.latent}));
  const double expected =
      supertac_loss(trainer.model().forward(by_hand.inputs, no_noise), by_hand.targets, settings.loss)
          .total.item();
  EXPECT_NEAR(trainer.train_step().total, expected, 1e-5 * expected);
  settings.augment = {};
  EXPECT_GT(std::abs(small.trainer().train_step().total - expected), 1e-3 * expected);
}

using MakeTrainer = std::function<Trainer()>;

std::string checkpoint_of(const MakeTrainer& make, int threads, std::int64_t interrupted_after) {
  const TemporaryFolder folder;
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  std::optional<Trainer> trainer(make());
  while (!trainer->done()) {
    trainer->train_step();
    if (trainer->step() == interrupted_after) {
      trainer->save(folder / "state.safetensors", {});
      trainer.emplace(make());
      trainer->restore(folder / "state.safetensors", {});
    }
  }
  trainer->save(folder / "end.safetensors", {});
  omp_set_num_threads(before);
  return file_text(folder / "end.safetensors");
}

// Windows, by Adam and by Muon, and single frames.
class TrainerBytes : public testing::Test {
 protected:
  TrainerBytes() {
    windows_.recipe.augment = {.gain = 0.5, .noise = 0.02};
    muon_.recipe.muon = true, muon_.recipe.epochs = 1;  // its steps take longer
    frames_.recipe.model.timesteps = 1, frames_.recipe.model.predicted_error = true;
    frames_.recipe.per_window = false;
    frames_.windows = small_windows(frames_.recipe.model, 40);
  }
  const std::vector<MakeTrainer> makers_ = {[this] { return windows_.trainer(); },
                                            [this] { return muon_.trainer(); },
                                            [this] { return frames_.trainer(); }};

 private:
  SmallTraining windows_, muon_, frames_;
};

TEST_F(TrainerBytes, AreTheSameForAnyNumberOfThreads) {
  for (const MakeTrainer& make : makers_) {
    const std::string one = checkpoint_of(make, 1, -1);
    for (const int threads : {2, 3, 4})
      EXPECT_TRUE(one == checkpoint_of(make, threads, -1)) << threads << " threads";
  }
}

TEST_F(TrainerBytes, AreTheSameResumedAfterAnyStep) {
  for (const MakeTrainer& make : makers_) {
    const std::string uninterrupted = checkpoint_of(make, 1, -1);
    for (std::int64_t step = 1; step < make().total_steps(); ++step)
      ASSERT_TRUE(uninterrupted == checkpoint_of(make, 1, step)) << "stopped after step " << step;
  }
}

// The bits of a training, as they are on every processor: whoever changes the arithmetic, the order of
// samples or the random numbers on purpose changes this number with it, and says so.
TEST(Trainer, PinnedBits) {
  const kernels::IsaKernels& before = kernels::isa_kernels();
  for (const kernels::IsaKernels* set : kernels::supported_sets()) {
    if (set == &kernels::kPlainKernels) continue;  // takes no Winograd's way
    kernels::use_isa(*set);
    for (const int threads : {1, 2, 4, 8}) {
      omp_set_num_threads(threads);
      SmallTraining small;
      small.recipe.augment = kStandardAugmentation;
      Trainer trainer = small.trainer();
      while (!trainer.done()) trainer.train_step();
      std::uint32_t bits = 0;
      for (const Parameter& p : trainer.model().parameters())
        bits = crc32(std::as_bytes(std::span<const real>(p.value.value().values())), bits);
      EXPECT_EQ(bits, 0x1BABFD50U) << set->name << ", " << threads << " threads";
    }
  }
  kernels::use_isa(before);
  omp_set_num_threads(1);
}

TEST(Trainer, RefusesToResumeAnotherRunOrAModelWithoutState) {
  const TemporaryFolder folder;
  SmallTraining small;
  Trainer trainer = small.trainer();
  trainer.train_step();
  trainer.save(folder / "state.safetensors", {{"data", "1234"}});
  const auto resume = [&](const std::string& data) {
    small.trainer().restore(folder / "state.safetensors", {{"data", data}});
  };
  EXPECT_NO_THROW(resume("1234"));
  EXPECT_ERROR(resume("5678"), std::runtime_error, "cannot resume: its data is 1234, this run's is 5678");
  save_model(folder / "m.safetensors", trainer.model(), {}, {{"training", training_text(small.recipe)}});
  EXPECT_ERROR(trainer.restore(folder / "m.safetensors", {}), std::runtime_error, "holds no training state");
  small.recipe.muon = true;
  EXPECT_ERROR(resume("1234"), std::runtime_error, "cannot resume: its training is");
}

// The message of the step after `damage` has been done to the parameter of that name.
std::string stopped(const std::string& name, const std::function<void(Tensor&)>& damage) {
  const SmallTraining small;
  Trainer trainer = small.trainer();
  trainer.train_step();
  damage(parameter_of(trainer.model(), name).mutable_value());
  return what_of<TrainingStopped>([&] { trainer.train_step(); });
}

TEST(Trainer, StopsWithStepLayerAndAdviceWhenAValueIsNotFinite) {
  const std::string advice = "; lower --learning-rate (now 0.001) or check the input with supertac-info";
  const std::string parameter = stopped("upsampler.rirb.0.conv.weight", [](Tensor& t) {
    t.data()[3] = std::numeric_limits<real>::quiet_NaN();
  });
  EXPECT_TRUE(parameter.starts_with("training stopped at step 2: the loss is nan (reconstruction "))
      << parameter;
  EXPECT_TRUE(parameter.ends_with("): parameter upsampler.rirb.0.conv.weight is not finite" + advice))
      << parameter;
  const std::string layer = stopped("decoder.2.fc.1.weight", [](Tensor& t) { t.fill(1e38F); });
  EXPECT_NE(layer.find("the output of linear"), std::string::npos) << layer;
  EXPECT_TRUE(layer.ends_with(" in decoder.2.fc.1 is the first that is not finite" + advice)) << layer;
  const std::string gradient = stopped("upsampler.out.weight", [](Tensor& t) { t.fill(1e19F); });
  EXPECT_NE(gradient.find("upsampler.out"), std::string::npos) << gradient;
  EXPECT_TRUE(gradient.ends_with(advice)) << gradient;
}

// A network whose last layer is dead draws a flat image and learns nothing any more, and one whose encoders
// are dead draws the same one for all; the detector must say so, and must keep quiet about a healthy run.
TEST(Trainer, ReportsPicturesThatAreTheSameForAllAndIdleLatents) {
  SmallTraining small;
  small.recipe.epochs = 10;
  StepReport last;
  const auto steps_until_reported = [&](const std::string& dead) {
    Trainer trainer = small.trainer();
    for (const Parameter& p : trainer.model().parameters()) {
      if (p.name.find(dead) != std::string::npos) Variable(p.value).mutable_value().fill(0);
    }
    while (!trainer.done()) {
      last = trainer.train_step();
      if (last.collapsed) return trainer.step();
    }
    return std::int64_t{0};
  };
  EXPECT_EQ(steps_until_reported("none"), 0);
  EXPECT_GT(last.active_latents, 0);
  small.recipe.learning_rate = 1e-9;
  small.recipe.warm_up = 0;
  EXPECT_EQ(steps_until_reported("upsampler.out"), 100);
  EXPECT_EQ(steps_until_reported(".mean."), 100);
  EXPECT_EQ(last.active_latents, 0);
}

TEST(Trainer, RefusesWindowsOfAnotherFormatOrNoneAndWhatTheArrayCannotDo) {
  SmallTraining small;
  const WindowSet& windows = small.windows;
  EXPECT_REFUSAL("batching: windows expects one to train on, or more, got none",
                 Trainer(windows, {}, small.recipe));
  small.recipe.model.timesteps = 48;
  EXPECT_REFUSAL(
      "the data have 32 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 8x8, the model "
      "expects 48 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 8x8",
      small.trainer());
  small.recipe.augment.dropped = 17;
  EXPECT_REFUSAL("augmentation: dropped expects 0 to 16, got 17", small.trainer());
}

}  // namespace supertac::trainer_test
