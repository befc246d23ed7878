#include "models/trainer.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>
#include <functional>

#include "models/evaluation.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

TEST(Trainer, Learns) {
  TrainingSettings settings = small_training();
  settings.epochs = 30;
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  const double first = trainer.train_step().l2;
  double last = 0;
  while (!trainer.done()) last = trainer.train_step().l2;
  EXPECT_LT(last, first / 4);
}

// Without noise the picture of the first step is that of inference.
TEST(Trainer, WithoutSamplingLatentsAreTheMeans) {
  TrainingSettings settings = small_training();
  settings.loss.beta = 0;
  const WindowSet windows = small_windows(settings.model);
  settings.batch = static_cast<std::int64_t>(windows.size());
  const auto errors = [&](bool sampling) {
    settings.sampling = sampling;
    Trainer trainer(windows, all_of(windows), settings);
    const ContactMetrics scores = score(trainer.model(), windows, all_of(windows));
    const double inferred = std::pow(10, -scores.all().psnr_pooled_db / 10);
    return std::abs(trainer.train_step().l2 - inferred) / inferred;
  };
  EXPECT_LT(errors(false), 1e-4);
  EXPECT_GT(errors(true), 1e-3);
  EXPECT_NE(settings.text().find("\"beta\":0.0"), std::string::npos);
}

std::string checkpoint_of(int threads, std::int64_t interrupted_after) {
  const TemporaryFolder folder;
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  TrainingSettings settings = small_training();
  settings.augment.gain = 0.5;
  settings.augment.noise = 0.02;
  const WindowSet windows = small_windows(settings.model);
  auto trainer = std::make_unique<Trainer>(windows, all_of(windows), settings);
  while (!trainer->done()) {
    trainer->train_step();
    if (trainer->step() == interrupted_after) {
      trainer->save(folder / "state.safetensors", {});
      trainer = std::make_unique<Trainer>(windows, all_of(windows), settings);
      trainer->restore(folder / "state.safetensors", {});
    }
  }
  trainer->save(folder / "end.safetensors", {});
  omp_set_num_threads(before);
  return file_text(folder / "end.safetensors");
}

TEST(Trainer, SameBytesForAnyNumberOfThreads) {
  const std::string one = checkpoint_of(1, -1);
  for (const int threads : {2, 3, 4}) EXPECT_TRUE(one == checkpoint_of(threads, -1)) << threads << " threads";
}

TEST(Trainer, ResumesToTheSameBytesAfterEveryStep) {
  const std::string uninterrupted = checkpoint_of(1, -1);
  for (std::int64_t step = 1; step <= 50; ++step) {
    ASSERT_TRUE(uninterrupted == checkpoint_of(1, step)) << "stopped after step " << step;
  }
}

TEST(Trainer, RefusesToResumeAnotherRun) {
  const TemporaryFolder folder;
  TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  trainer.train_step();
  trainer.save(folder / "state.safetensors", {{"data", "1234"}});
  const auto message = [&](const TrainingSettings& other, const std::string& data) -> std::string {
    try {
      Trainer(windows, all_of(windows), other).restore(folder / "state.safetensors", {{"data", data}});
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(message(settings, "1234"), "no error");
  EXPECT_NE(message(settings, "5678").find("cannot resume: its data is 1234, this run's is 5678"),
            std::string::npos);
  settings.seed = 4;
  EXPECT_NE(message(settings, "1234").find("cannot resume: its training is"), std::string::npos);
}

TEST(Trainer, RefusesToResumeFromAModelWithoutState) {
  const TemporaryFolder folder;
  const TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  save_model(folder / "m.safetensors", trainer.model(), {}, {{"training", settings.text()}});
  try {
    trainer.restore(folder / "m.safetensors", {});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("holds no training state"), std::string::npos) << error.what();
  }
}

// The message of the step after `damage` has been done to the parameter of that name.
std::string stopped(const std::string& name, const std::function<void(Tensor&)>& damage) {
  const TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  trainer.train_step();
  for (const Parameter& p : trainer.model().parameters()) {
    if (p.name == name) damage(Variable(p.value).mutable_value());
  }
  try {
    trainer.train_step();
  } catch (const TrainingStopped& error) {
    return error.what();
  }
  return "no error";
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
  TrainingSettings settings = small_training();
  settings.epochs = 10;
  const WindowSet windows = small_windows(settings.model);
  StepReport last;
  const auto steps_until_reported = [&](const TrainingSettings& s, const std::string& dead) {
    Trainer trainer(windows, all_of(windows), s);
    for (const Parameter& p : trainer.model().parameters()) {
      if (p.name.find(dead) != std::string::npos) Variable(p.value).mutable_value().fill(0);
    }
    while (!trainer.done()) {
      last = trainer.train_step();
      if (last.collapsed) return trainer.step();
    }
    return std::int64_t{0};
  };
  EXPECT_EQ(steps_until_reported(settings, "none"), 0);
  EXPECT_GT(last.active_latents, 0);
  settings.learning_rate = 1e-9;
  settings.warm_up = 0;
  EXPECT_EQ(steps_until_reported(settings, "upsampler.out"), 100);
  EXPECT_EQ(steps_until_reported(settings, ".mean."), 100);
  EXPECT_EQ(last.active_latents, 0);
}

TEST(Trainer, RefusesWindowsOfAnotherLength) {
  TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  settings.model.timesteps = 48;
  EXPECT_THROW(Trainer(windows, all_of(windows), settings), std::invalid_argument);
}

}  // namespace
}  // namespace supertac
