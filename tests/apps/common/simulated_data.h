// A small simulated data set that all tests of a suite share.
#pragma once

#include <memory>
#include <string>

#include "io/files/file.h"
#include "tests/apps/common/expect.h"

namespace supertac {

/// One pass of each of two trials over 3_Bumps lie in path("data").
class OnSimulatedData : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    succeed("supertac-simulate --out data --plates 3_Bumps --speeds 10 --passes 1");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  // In the folder.
  static ProcessResult run(const std::string& line, const ProcessOptions& how = {}) {
    return run_in(folder_->path(), line, how);
  }
  static ProcessResult succeed(const std::string& line, const ProcessOptions& how = {}) {
    return succeed_in(folder_->path(), line, how);
  }
  static std::string path(const std::string& name) { return *folder_ / name; }
  static std::string bytes(const std::string& name) { return read_text_file(path(name), 1 << 26); }

  static inline std::unique_ptr<TemporaryFolder> folder_;
};

}  // namespace supertac
