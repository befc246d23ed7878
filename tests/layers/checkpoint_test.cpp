#include "layers/checkpoint.h"

#include "layers/convolution.h"
#include "tests/support/test.h"

namespace supertac::checkpoint_test {

class CheckpointTest : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }
  TemporaryFolder folder_;
};

// Fills a parameter with 0, 1, 2 ... in memory order.
Parameter counting(const std::string& name, const Shape& shape, Layout layout) {
  Tensor t(shape);
  std::iota(t.values().begin(), t.values().end(), real(0));
  return {name, Variable(t, true), layout};
}

TEST_F(CheckpointTest, ComesBackToTheBit) {
  Rng a(1), b(2);
  const Conv2d written(3, 5, {}, a), read(3, 5, {}, b);
  write_checkpoint(path("c.safetensors"), written.parameters(), {{"note", "x"}});
  const SafetensorsFile file = SafetensorsFile::read(path("c.safetensors"));
  EXPECT_EQ(file.metadata().at("note"), "x");
  load_parameters(file, read.parameters());
  for (std::size_t i = 0; i < 2; ++i) {
    const auto x = written.parameters()[i].value.value().values(),
               y = read.parameters()[i].value.value().values();
    EXPECT_TRUE(std::equal(x.begin(), x.end(), y.begin()));
  }
}

TEST_F(CheckpointTest, ListsEveryProblemAtOnceAndChangesNothing) {
  write_checkpoint(path("c.safetensors"),
                   {counting("fine", {2}, Layout::plain), counting("shape", {2, 3}, Layout::linear),
                    counting("extra", {1}, Layout::plain), counting("optimizer.m.fine", {2}, Layout::plain)},
                   {});
  const std::vector<Parameter> wanted{counting("fine", {2}, Layout::plain),
                                      counting("shape", {3, 3}, Layout::linear),
                                      counting("absent", {1}, Layout::plain)};
  Variable fine = wanted[0].value;
  fine.mutable_value().fill(7);
  EXPECT_EQ(what_of<std::runtime_error>([&] {
              load_parameters(SafetensorsFile::read(path("c.safetensors")), wanted, {"optimizer."});
            }),
            path("c.safetensors") +
                ": the tensors do not fit the model that its metadata describes: "
                "shape expected F32 [3,3], found F32 [3,2]; missing absent; unexpected extra");
  EXPECT_EQ(fine.value().data()[0], 7);
}

TEST_F(CheckpointTest, WritesNothingThatIsNotFinite) {
  const Parameter lost{"fc.bias", Variable(Tensor::full({2}, std::numeric_limits<real>::quiet_NaN()), true)};
  EXPECT_EQ(what_of<FileError>([&] { write_checkpoint(path("c.safetensors"), {lost}, {}); }),
            path("c.safetensors") +
                ": not written: fc.bias holds values that are not finite; the training "
                "diverged, lower its learning rate");
  EXPECT_FALSE(std::filesystem::exists(path("c.safetensors")));
}

TEST_F(CheckpointTest, RefusesOtherFilesAndNewerVersions) {
  const std::pair<std::map<std::string, std::string>, const char*> cases[] = {
      {{{"format", "supertac-recording"}}, "not a SuperTac checkpoint"},
      {{{"format", "supertac-checkpoint"}, {"format_version", "2"}},
       "checkpoint version \"2\", this program reads 1 to 1"},
      {{{"format", "supertac-checkpoint"}, {"format_version", "one"}}, "checkpoint version"}};
  for (const auto& [metadata, refusal] : cases) {
    write_safetensors(path("c.safetensors"), metadata, {});
    EXPECT_ERROR(check_checkpoint(SafetensorsFile::read(path("c.safetensors"))), std::runtime_error, refusal);
  }
}

}  // namespace supertac::checkpoint_test
