// examples/mini_supertac.cpp and the project, from one checkpoint, on the same windows.

#include <cstdio>
#include <fstream>

#include "autograd/optimisers/adam.h"
#include "layers/checkpoint.h"
#include "models/training/loss/loss.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wreturn-type"  // main() alone may do without
#define main mini_supertac_main
#include "examples/mini_supertac.cpp"
#include "tests/support/test.h"
#undef main
#pragma GCC diagnostic pop

namespace supertac::mini_supertac_test {

constexpr double kTolerance = sizeof(real) == 4 ? 1e-5 : 1e-9;

// Their windows are [time][taxel of all rows].
Tensor windows_of(const std::vector<Example>& batch) {
  const auto count = static_cast<Dim>(batch.size());
  Tensor windows(Shape{count, kTime, kSide * kSide});
  for (Dim n = 0; n < count; ++n)
    for (Dim t = 0; t < kTime; ++t)
      for (Dim k = 0; k < kSide * kSide; ++k)
        windows.data()[(n * kTime + t) * kSide * kSide + k] =
            static_cast<real>(batch[static_cast<std::size_t>(n)]
                                  .window[k / kSide][static_cast<std::size_t>(k % kSide * kTime + t)]);
  return windows;
}

Tensor rows_of(const std::vector<Example>& batch, const Shape& shape,
               const std::function<const Array&(const Example&)>& part) {
  std::vector<real> all;
  for (const Example& e : batch)
    for (const double x : part(e)) all.push_back(static_cast<real>(x));
  return Tensor::of(shape, all);
}

std::vector<Example> touches(int count) {
  std::vector<Example> batch;
  for (int i = 0; i < count; ++i) batch.push_back(touch());
  return batch;
}

TEST(MiniSuperTac, HasTheProjectsLossesAndPicture) {
  Rng rng(4);
  const SuperTac model(SuperTacSettings::of_preset("tiny"), rng);
  const std::string path = testing::TempDir() + "mini_" + std::to_string(sizeof(real)) + ".safetensors";
  write_checkpoint(path, model.parameters(), {});
  load_parameters(SafetensorsFile::read(path), model.parameters());
  weights.clear();
  load(path);
  std::remove(path.c_str());
  Adam adam(values_of(model.parameters()), {.clip_norm = 1});
  constexpr Dim kBatch = 4;
  for (int step = 1; step <= 10; ++step) {
    std::vector<Example> batch = touches(kBatch);
    if (step == 5) batch[1].truth.assign(256, 0.25);  // flat: SSIM has nothing to compare
    std::vector<Tensor> eps;
    for (int g = 0; g < kSide; ++g)
      eps.push_back(
          rows_of(batch, {kBatch, kLatent}, [g](const Example& e) -> const Array& { return e.eps[g]; }));
    const Tensor truth =
        rows_of(batch, {kBatch, 16, 16, 1}, [](const Example& e) -> const Array& { return e.truth; });
    const Variable loss = supertac_loss(model.forward(windows_of(batch), eps), truth, {}).total;
    adam.zero_grad();
    backward(loss);
    adam.set_learning_rate(2e-3 * step / 50);
    adam.step();
    EXPECT_NEAR(train_step(batch, step), static_cast<double>(loss.item()), kTolerance) << "step " << step;
  }
  std::vector<Example> unseen = touches(1);
  for (Array& eps : unseen[0].eps) eps.assign(kLatent, 0);
  const Drawn mine = ::draw(unseen[0]);
  const NoGrad no_grad;
  const Prediction theirs = model.draw(Variable(windows_of(unseen)));
  for (std::size_t i = 0; i < 256; ++i) {
    ASSERT_NEAR(mine.picture->value[i], static_cast<double>(theirs.picture.value().data()[i]), kTolerance)
        << i;
    ASSERT_NEAR(mine.error->value[i], static_cast<double>(theirs.predicted_error.value().data()[i]),
                kTolerance)
        << i;
  }
}

TEST(MiniSuperTac, RefusesWhatItCannotLoad) {
  EXPECT_THROW(load(SUPERTAC_MINI), std::runtime_error);
  weights.clear();
  weights["upsampler.out.bias"] = ::tensor({3});
  EXPECT_THROW(::draw(touch()), std::runtime_error);
  weights.clear(), tape.clear();
}

TEST(MiniSuperTac, FitsOnAFewPages) {
  std::ifstream file(SUPERTAC_MINI);
  int lines = 0;
  for (std::string line; std::getline(file, line); ++lines) EXPECT_LE(line.size(), 110U) << line;
  EXPECT_LE(lines, 300);
  EXPECT_GT(lines, 0);
}

}  // namespace supertac::mini_supertac_test
