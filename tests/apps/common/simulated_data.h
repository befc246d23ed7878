// A small simulated data set that all tests of a suite share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "io/files/file.h"
#include "tests/apps/common/process.h"
#include "tests/io/temporary_folder.h"

namespace supertac {

/// One pass of each of two trials over 3_Bumps lie in path("data").
class OnSimulatedData : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    const ProcessResult made = run_process("supertac-simulate", {"--out", path("data"), "--plates", "3_Bumps",
                                                                 "--speeds", "10", "--passes", "1"});
    ASSERT_EQ(made.code, 0) << made.error;
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string path(const std::string& name) { return *folder_ / name; }
  static std::string bytes(const std::string& name) { return read_text_file(path(name), 1 << 26); }

  static inline std::unique_ptr<TemporaryFolder> folder_;
};

}  // namespace supertac
