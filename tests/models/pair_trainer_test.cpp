#include "models/pair_trainer.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>
#include <memory>
#include <numeric>

#include "data/scores/metrics.h"
#include "models/model_file.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

/// Blurred blobs on an array of 3 x 5 taxels with two channels, drawn `scale` times as fine.
std::string write_pairs(const TemporaryFolder& folder, std::uint64_t scale = 4, std::uint64_t count = 40) {
  const std::uint64_t height = 3 * scale, width = 5 * scale;
  std::vector<float> input(count * 2 * 15), target(count * height * width);
  std::vector<std::int64_t> group;
  const RandomStream random(4, 0);
  for (std::uint64_t n = 0; n < count; ++n) {
    const double y = 3 * random.uniform(2 * n), x = 5 * random.uniform(2 * n + 1);
    const auto blob = [&](double row, double column, double width_of) {
      return static_cast<float>(std::exp(-((row - y) * (row - y) + (column - x) * (column - x)) / width_of));
    };
    for (std::uint64_t k = 0; k < 15; ++k) {
      const float v = blob(static_cast<double>(k / 5) + 0.5, static_cast<double>(k % 5) + 0.5, 2);
      input[n * 30 + k] = 1000 - 200 * v;  // falls when pressed, far from 0
      input[n * 30 + 15 + k] = 0.01F * v;
    }
    for (std::uint64_t p = 0; p < height * width; ++p) {
      const auto at = [&](std::uint64_t i) {
        return (static_cast<double>(i) + 0.5) / static_cast<double>(scale);
      };
      target[n * height * width + p] = blob(at(p / width), at(p % width), 0.5);
    }
    group.push_back(static_cast<std::int64_t>(n / 8));
  }
  write_safetensors(folder / "pairs.safetensors", {},
                    {{"input", "F32", {count, 2, 3, 5}, std::as_bytes(std::span(input))},
                     {"target", "F32", {count, 1, height, width}, std::as_bytes(std::span(target))},
                     {"group", "I64", {count}, std::as_bytes(std::span(group))}});
  return folder / "pairs.safetensors";
}

PairTrainingSettings small(const PairSet& pairs) {
  PairTrainingSettings s = PairTrainingSettings::of(pairs);
  s.model.channels = 8;
  s.model.rcabs = 1;
  s.epochs = 3;
  s.batch = 8;
  s.seed = 5;
  return s;
}

std::vector<std::uint32_t> first(std::uint32_t count) {
  std::vector<std::uint32_t> indices(count);
  std::iota(indices.begin(), indices.end(), 0U);
  return indices;
}

TEST(FrameModel, DrawsAnyArrayAtEveryScale) {
  for (const Dim scale : {2, 4, 8, 16}) {
    Rng rng(1);
    const FrameModel model(
        {.in_channels = 3, .height = 2, .width = 5, .scale = scale, .channels = 8, .rcabs = 1}, rng);
    EXPECT_EQ(model.infer(uniform({2, 2, 5, 3}, 1)).shape(), (Shape{2, 2 * scale, 5 * scale, 1}));
    EXPECT_THROW(model.infer(uniform({2, 5, 2, 3}, 1)), std::invalid_argument);
  }
  Rng rng(1);
  EXPECT_THROW(FrameModel({.scale = 3}, rng), std::invalid_argument);
  EXPECT_THROW(FrameModel({.in_channels = 0}, rng), std::invalid_argument);
  EXPECT_EQ(FrameModel({.channels = 8, .rcabs = 1}, rng).parameters()[0].name, "in.weight");
}

TEST(PairTrainer, Learns) {
  const TemporaryFolder folder;
  const PairSet pairs = PairSet::read(write_pairs(folder));
  PairTrainingSettings settings = small(pairs);
  settings.epochs = 60;
  settings.optimiser.learning_rate = 5e-3;
  PairTrainer trainer(pairs, first(32), settings);
  const double before = trainer.train_step().l2;
  double after = 0;
  while (!trainer.done()) after = trainer.train_step().l2;
  EXPECT_LT(after, before / 10);
  PairMetrics metrics(12, 20);
  std::vector<float> target(240);
  const std::vector<std::uint32_t> unseen = {32, 33, 34, 35, 36, 37, 38, 39};
  for_each_picture(trainer.model(), trainer.scaling(), pairs, unseen, [&](std::size_t i, auto picture) {
    pairs.target(unseen[i], target);
    metrics.add(picture, target);
    return true;
  });
  EXPECT_EQ(metrics.result().windows, 8u);
  EXPECT_GT(metrics.result().psnr_mean_db, 18);
}

std::string checkpoint_of(int threads, std::int64_t interrupted_after) {
  const TemporaryFolder folder;
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  const PairSet pairs = PairSet::read(write_pairs(folder));
  auto trainer = std::make_unique<PairTrainer>(pairs, first(32), small(pairs));
  while (!trainer->done()) {
    trainer->train_step();
    if (trainer->step() == interrupted_after) {
      trainer->save(folder / "state.safetensors", {});
      trainer = std::make_unique<PairTrainer>(pairs, first(32), small(pairs));
      trainer->restore(folder / "state.safetensors", {});
    }
  }
  trainer->save(folder / "end.safetensors", {});
  omp_set_num_threads(before);
  return file_text(folder / "end.safetensors");
}

TEST(PairTrainer, SameBytesForAnyThreadsAndAfterEveryPause) {
  const std::string plain = checkpoint_of(1, -1);
  for (const int threads : {2, 3, 4}) EXPECT_TRUE(plain == checkpoint_of(threads, -1)) << threads;
  for (std::int64_t step = 1; step < 12; ++step)
    EXPECT_TRUE(plain == checkpoint_of(1, step)) << "stopped after step " << step;
}

TEST(PairTrainer, RefusesAnotherRunAndOtherPairs) {
  const TemporaryFolder folder, other_folder;
  const PairSet pairs = PairSet::read(write_pairs(folder));
  PairTrainer trainer(pairs, first(32), small(pairs));
  trainer.train_step();
  trainer.save(folder / "state.safetensors", {{"data", "1"}});
  PairTrainingSettings other = small(pairs);
  other.lambda = 0.2;
  EXPECT_THROW(PairTrainer(pairs, first(32), other).restore(folder / "state.safetensors", {}),
               std::runtime_error);
  EXPECT_THROW(
      PairTrainer(pairs, first(32), small(pairs)).restore(folder / "state.safetensors", {{"data", "2"}}),
      std::runtime_error);
  const PairSet coarse = PairSet::read(write_pairs(other_folder, 8));
  EXPECT_THROW(PairTrainer(coarse, first(32), small(pairs)), std::invalid_argument);
  EXPECT_THROW(PairTrainer(pairs, {}, small(pairs)), std::invalid_argument);
}

TEST(FrameFile, ComesBackWithItsScalingAndPictures) {
  const TemporaryFolder folder;
  Rng rng(2);
  const FrameModel model({.in_channels = 2, .height = 3, .width = 5, .scale = 2, .channels = 8, .rcabs = 1},
                         rng);
  const ChannelScaling scaling{{0.1F, 1e-7F}, {3, 1e6F}};
  save_frame_model(folder / "m.safetensors", model, scaling, {{"split", "group"}});
  const FrameFile file = load_frame_model(folder / "m.safetensors");
  EXPECT_EQ(file.scaling.mean, scaling.mean);
  EXPECT_EQ(file.scaling.factor, scaling.factor);
  EXPECT_EQ(file.metadata.at("split"), "group");
  const Tensor x = uniform({2, 3, 5, 2}, 1), a = model.infer(x), b = file.model->infer(x);
  for (Dim i = 0; i < a.size(); ++i) EXPECT_EQ(a.data()[i], b.data()[i]);
}

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

TEST(FrameFile, NeitherKindIsTakenForTheOther) {
  const TemporaryFolder folder;
  Rng rng(2);
  save_frame_model(folder / "frame.safetensors", FrameModel({.channels = 8, .rcabs = 1}, rng), {{0}, {1}},
                   {});
  save_model(folder / "window.safetensors", SuperTac(small_settings(), rng), {}, {});
  EXPECT_NE(error_of([&] { load_model(folder / "frame.safetensors"); }).find("found a frame model"),
            std::string::npos);
  EXPECT_NE(error_of([&] { load_frame_model(folder / "window.safetensors"); }).find("found a SuperTac model"),
            std::string::npos);
}

TEST(FrameFile, TheFileNeverSizesAnything) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  Rng rng(1);
  const FrameModel model({.channels = 8, .rcabs = 1}, rng);
  const auto write = [&](const std::string& height, const std::string& mean) {
    write_checkpoint(
        path, model.parameters(),
        {{"kind", kFrameKind},
         {"settings",
          R"({"in_channels":1,"width":4,"scale":4,"channels":8,"rcabs":1,"height":)" + height + "}"},
         {"input", R"({"mean":)" + mean + R"(,"factor":[1]})"}});
    return error_of([&] { load_frame_model(path); });
  };
  EXPECT_EQ(write("4", "[0]"), "no error");
  EXPECT_NE(write("100000", "[0]").find("height must be 1 to 512"), std::string::npos);
  EXPECT_NE(write("\"4\"", "[0]").find("must be a whole number"), std::string::npos);
  for (const char* mean : {"[0,0]", "[]", "[null]", "0", "[1e300]"})
    EXPECT_NE(write("4", mean).find("\"mean\" must be 1 finite numbers"), std::string::npos)
        << mean << write("4", mean);
}

}  // namespace
}  // namespace supertac
