#include "data/windows/pairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>

#include "data/scores/baselines.h"
#include "data/scores/metrics.h"
#include "data/windows/split.h"
#include "io/files/file.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

/// A file of pairs that a test can spoil before it is written.
struct PairFile {
  std::vector<std::uint64_t> input_shape = {10, 2, 3, 5}, target_shape = {10, 1, 12, 20};
  std::vector<float> input = std::vector<float>(10 * 2 * 3 * 5), target = std::vector<float>(10 * 12 * 20);
  std::vector<std::int64_t> group = {7, 7, -3, -3, 7, 9, 9, 12, 12, 40};
  bool with_group = true;
  std::string dtype = "F32";

  PairFile() {
    for (std::size_t i = 0; i < input.size(); ++i) input[i] = static_cast<float>(i);
    for (std::size_t i = 0; i < target.size(); ++i) target[i] = static_cast<float>(i % 101) / 100;
  }
  std::string write(const TemporaryFolder& folder) const {
    std::vector<TensorToWrite> tensors = {{"input", dtype, input_shape, std::as_bytes(std::span(input))},
                                          {"target", "F32", target_shape, std::as_bytes(std::span(target))}};
    if (with_group) tensors.push_back({"group", "I64", {10}, std::as_bytes(std::span(group))});
    write_safetensors(folder / "pairs.safetensors", {}, tensors);
    return folder / "pairs.safetensors";
  }
};

void expect_refused(const PairFile& file, const std::string& expected) {
  const TemporaryFolder folder;
  try {
    PairSet::read(file.write(folder));
    ADD_FAILURE() << "accepted; expected: " << expected;
  } catch (const FileError& error) {
    EXPECT_NE(std::string(error.what()).find(expected), std::string::npos) << error.what();
  }
}

TEST(Pairs, ChannelsComeLastAndScaled) {
  const TemporaryFolder folder;
  PairSet pairs = PairSet::read(PairFile().write(folder));
  EXPECT_EQ(pairs.size(), 10u);
  EXPECT_EQ(pairs.array().channels, 2);
  EXPECT_EQ(pairs.scale(), 4);
  EXPECT_EQ(pairs.image().width, 20);
  EXPECT_EQ(pairs.group(2), -3);
  std::vector<float> input(30), target(240);
  pairs.set_scaling({{100, 0}, {1, 0.5F}});
  pairs.input(4, input);
  // Pair 4 begins at 120; row 1, column 2 of channel 0 is 120 + 7, of channel 1 120 + 15 + 7.
  EXPECT_EQ(input[(1 * 5 + 2) * 2], 27);
  EXPECT_EQ(input[(1 * 5 + 2) * 2 + 1], 71);
  pairs.target(4, target);
  EXPECT_EQ(target[3], static_cast<float>((4 * 240 + 3) % 101) / 100);
  EXPECT_THROW(pairs.target(0, input), std::invalid_argument);
  EXPECT_THROW(pairs.set_scaling({{0}, {1}}), std::invalid_argument);
}

TEST(Pairs, ScalingIsThatOfTheTrainingPairs) {
  const TemporaryFolder folder;
  PairFile file;
  for (std::size_t i = 0; i < file.input.size();
       ++i)  // channel 0 alternates 999999, 1000001; channel 1 is constant
    file.input[i] = (i / 15) % 2 == 0 ? 1e6F + (i % 2 == 0 ? 1 : -1) : 5;
  PairSet pairs = PairSet::read(file.write(folder));
  std::vector<std::uint32_t> all(10);
  std::iota(all.begin(), all.end(), 0U);
  pairs.fit_scaling(all);
  const ChannelScaling scaling = pairs.scaling();
  EXPECT_NEAR(scaling.mean[0], 1e6, 0.2);
  EXPECT_NEAR(scaling.factor[0], 1, 0.01);
  EXPECT_EQ(scaling.mean[1], 5);
  EXPECT_EQ(scaling.factor[1], 1);
  pairs.fit_scaling(all);
  EXPECT_EQ(pairs.scaling().mean, scaling.mean) << "the scaling before has no part in it";
  EXPECT_THROW(pairs.fit_scaling({}), std::invalid_argument);
}

TEST(Pairs, RefusesWhatDoesNotFitTogether) {
  PairFile file;
  file.target_shape = {10, 1, 20, 12};
  expect_refused(file, "input [10,2,3,5], target [10,1,20,12]: expected target's height and width to be 2");
  file = {};
  file.target_shape = {5, 2, 12, 20};
  expect_refused(file, "as many targets as inputs");
  file = {};
  file.input_shape = {10, 30, 1};
  expect_refused(file, "tensor 'input' is F32 [10,30,1], expected F32 [N,C,H,W]");
  file = {};
  file.dtype = "I32";
  expect_refused(file, "tensor 'input' is I32");
  file = {};
  file.input[65] = std::nanf("");
  expect_refused(file, "input of pair 2 holds nan, expected finite values");
  file = {};
  file.target[240] = 1.5F;
  expect_refused(file, "target of pair 1 holds 1.5, expected 0 to 1");
  file = {};
  file.input_shape = {10, 2, 15, 1};
  file.target_shape = {10, 1, 120, 2};
  expect_refused(file, "times input's");
}

TEST(Pairs, RefusesGroupsOfAnotherShapeAndMissingTensors) {
  const TemporaryFolder folder;
  const std::vector<float> values(40);
  const std::vector<std::int64_t> group(3);
  const std::string path = folder / "a.safetensors";
  write_safetensors(path, {}, {{"input", "F32", {1, 1, 5, 8}, std::as_bytes(std::span(values))}});
  EXPECT_THROW(PairSet::read(path), FileError);
  const std::vector<float> target(160);
  write_safetensors(path, {},
                    {{"input", "F32", {1, 1, 5, 8}, std::as_bytes(std::span(values))},
                     {"target", "F32", {1, 1, 10, 16}, std::as_bytes(std::span(target))},
                     {"group", "I64", {3}, std::as_bytes(std::span(group))}});
  EXPECT_THROW(PairSet::read(path), FileError);
}

TEST(Pairs, GroupsStayTogether) {
  const TemporaryFolder folder;
  PairFile file;
  const PairSet pairs = PairSet::read(file.write(folder));
  std::set<std::int64_t> tested_ever;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Split split = split_pairs(pairs, "group", seed);
    EXPECT_EQ(split.train.size() + split.test.size(), 10u);
    std::set<std::int64_t> train, test;
    for (const std::uint32_t i : split.train) train.insert(pairs.group(i));
    for (const std::uint32_t i : split.test) test.insert(pairs.group(i));
    EXPECT_EQ(test.size(), 1u);  // a fifth of five
    EXPECT_FALSE(train.contains(*test.begin()));
    tested_ever.insert(*test.begin());
  }
  EXPECT_EQ(tested_ever.size(), 5u);
  EXPECT_EQ(split_pairs(pairs, "pair", 1).test.size(), 2u);
  EXPECT_EQ(split_pairs(pairs, "none", 1).train.size(), 10u);
  EXPECT_THROW(split_pairs(pairs, "trial", 1), std::invalid_argument);
  file.with_group = false;
  const PairSet loose = PairSet::read(file.write(folder));
  EXPECT_THROW(split_pairs(loose, "group", 1), std::invalid_argument);
  EXPECT_NE(loose.fingerprint(), pairs.fingerprint());
}

TEST(PairMetrics, AreThoseOfTheImages) {
  const std::vector<float> flat(12 * 20, 0.5F), grey(12 * 20, 0.6F);
  PairMetrics metrics(12, 20);
  EXPECT_TRUE(std::isnan(metrics.result().ssim));
  metrics.add(flat, flat);
  metrics.add(grey, flat);
  EXPECT_NEAR(metrics.result().psnr_mean_db, (60 + 20) / 2.0, 1e-4);
  EXPECT_NEAR(metrics.result().psnr_pooled_db, 20 + 10 * std::log10(2.0), 1e-4);
  EXPECT_NEAR(metrics.result().ssim, (1 + ssim(grey, flat, 12, 20)) / 2, 1e-12);
  EXPECT_THROW(metrics.add(std::vector<float>(240, std::nanf("")), flat), std::invalid_argument);
  EXPECT_THROW(PairMetrics(12, 12).add(flat, flat), std::invalid_argument);
}

// The targets are a line of the enlarged input, so the fitted baseline is exact.
TEST(Baselines, NearestFindsTheLineOfPairs) {
  const TemporaryFolder folder;
  PairFile file;
  for (std::size_t n = 0; n < 10; ++n)
    for (std::size_t r = 0; r < 12; ++r)
      for (std::size_t c = 0; c < 20; ++c) {
        const std::size_t at = n * 30 + (r / 4) * 5 + c / 4;
        file.input[at + 15] = file.input[at] = static_cast<float>((at * 7919) % 97);
        file.target[(n * 12 + r) * 20 + c] = 0.9F - file.input[at] / 120;
      }
  PairSet pairs = PairSet::read(file.write(folder));
  const std::vector<std::uint32_t> train = {0, 1, 2, 3, 4, 5};
  pairs.fit_scaling(train);
  const Baselines baselines = fit_baselines(pairs, train);
  ASSERT_EQ(baselines.size(), 3u);
  std::vector<float> input(30), out(240), target(240);
  pairs.input(9, input);
  pairs.target(9, target);
  baselines[1]->predict(input, out);
  EXPECT_EQ(baselines[1]->name(), "nearest");
  for (std::size_t p = 0; p < out.size(); ++p) EXPECT_NEAR(out[p], target[p], 1e-5);
  baselines[0]->predict(input, out);
  EXPECT_GT(mean_squared_error(out, target), 0.01);
}

}  // namespace
}  // namespace supertac
