#include "io/files/scratch_file.h"

#include "io/files/file.h"
#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::scratch_file_test {

std::vector<float> numbers(std::size_t count, float first) {
  std::vector<float> all(count);
  std::iota(all.begin(), all.end(), first);
  return all;
}

class ScratchFiles : public testing::Test {
 protected:
  ScratchFiles() { ::setenv("TMPDIR", folder_.path().c_str(), 1); }
  ~ScratchFiles() override { ::unsetenv("TMPDIR"); }
  TemporaryFolder folder_;
};

TEST_F(ScratchFiles, GiveBackWhatWasAppendedAndLeaveNoName) {
  ScratchFile file;
  EXPECT_EQ(file.append(numbers(10'000, 0)), 0U);
  EXPECT_EQ(file.append(numbers(3, 50)), 10'000U);
  std::vector<float> part(5);
  file.read(9'998, part);
  EXPECT_EQ(part, (std::vector<float>{9998, 9999, 50, 51, 52}));
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  EXPECT_THROW(file.read(9'999, part), FileError);  // it ends before
}

TEST_F(ScratchFiles, FailWithAnErrorWhateverCallFails) {
  for (const Fault fault : {Fault::error, Fault::short_count})
    for (int at = 1; at <= 3; ++at) {
      const FaultInjection injection(at, ENOSPC, false, fault);
      try {
        ScratchFile file;
        file.append(numbers(1000, 0));
        std::vector<float> all(1000);
        file.read(0, all);
        EXPECT_EQ(all, numbers(1000, 0));
        EXPECT_TRUE(fault == Fault::short_count) << at;
      } catch (const FileError& error) {
        EXPECT_TRUE(fault == Fault::error);
        EXPECT_NE(std::string(error.what()).find("set TMPDIR to a folder on a disk with room"),
                  std::string::npos);
      }
    }
}

}  // namespace supertac::scratch_file_test
