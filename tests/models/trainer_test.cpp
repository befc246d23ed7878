#include "models/trainer.h"

#include <gtest/gtest.h>
#include <omp.h>

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

TEST(Trainer, StopsWithStepLayerAndAdviceWhenAValueIsNotFinite) {
  TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  trainer.train_step();
  for (const Parameter& p : trainer.model().parameters()) {
    if (p.name != "upsampler.out.bias") continue;
    Variable bias = p.value;
    bias.mutable_value().fill(std::numeric_limits<real>::quiet_NaN());
  }
  try {
    trainer.train_step();
    FAIL();
  } catch (const TrainingStopped& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("training stopped at step 2: the loss is nan"), std::string::npos) << text;
    EXPECT_NE(text.find("lower --learning-rate (now 0.001)"), std::string::npos) << text;
  }
}

// A network whose last layer is dead draws a flat image and learns nothing any more; the detector must say
// so, and must keep quiet about a healthy run.
TEST(Trainer, ReportsACollapsedPicture) {
  TrainingSettings settings = small_training();
  settings.epochs = 10;
  const WindowSet windows = small_windows(settings.model);
  const auto steps_until_reported = [&](const TrainingSettings& s, bool dead) {
    Trainer trainer(windows, all_of(windows), s);
    for (const Parameter& p : trainer.model().parameters()) {
      if (dead && p.name.starts_with("upsampler.out")) Variable(p.value).mutable_value().fill(0);
    }
    while (!trainer.done()) {
      if (trainer.train_step().collapsed) return trainer.step();
    }
    return std::int64_t{0};
  };
  EXPECT_EQ(steps_until_reported(settings, false), 0);
  settings.learning_rate = 1e-9;
  EXPECT_EQ(steps_until_reported(settings, true), 100);
}

TEST(Trainer, RefusesWindowsOfAnotherLength) {
  TrainingSettings settings = small_training();
  const WindowSet windows = small_windows(settings.model);
  settings.model.timesteps = 48;
  EXPECT_THROW(Trainer(windows, all_of(windows), settings), std::invalid_argument);
}

}  // namespace
}  // namespace supertac
