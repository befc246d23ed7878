// What tests expect of programs, said in one line each, and folders and data for them to work on.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "io/files/file.h"
#include "tests/apps/common/process.h"

namespace supertac {

/// Whether `part` stands in `text`, whose beginning is shown where that is not as expected.
inline testing::AssertionResult contains(std::string_view text, std::string_view part) {
  return testing::AssertionResult(text.find(part) != text.npos)
         << "'" << part << "' and: " << text.substr(0, 4000);
}

/// It ended with this code, and said so on stderr.
inline void expect_exit(const ProcessResult& result, int code, std::string_view part) {
  EXPECT_EQ(result.code, code) << result.error;
  EXPECT_TRUE(contains(result.error, part));
}

/// The same, and that line, which begins with the program's name, was all it said.
inline void expect_failure(const ProcessResult& result, int code, std::string_view part) {
  expect_exit(result, code, part);
  EXPECT_EQ(std::ranges::count(result.error, '\n'), 1) << result.error;
  EXPECT_TRUE(result.error.starts_with("supertac")) << result.error;
}

/// run_in() of what has to succeed.
inline ProcessResult succeed_in(const std::string& folder, const std::string& line,
                                const ProcessOptions& options = {}) {
  ProcessResult result = run_in(folder, line, options);
  EXPECT_EQ(result.code, 0) << line << ": " << result.error << result.out;
  return result;
}

/// A folder in which programs run.
class WithFolder : public testing::Test {
 protected:
  static ProcessResult run(const std::string& line, const ProcessOptions& how = {}) {
    return run_in(folder_->path(), line, how);
  }
  static ProcessResult succeed(const std::string& line, const ProcessOptions& how = {}) {
    return succeed_in(folder_->path(), line, how);
  }
  static RunningProcess start(const std::string& line) { return start_in(folder_->path(), line); }
  static std::string path(const std::string& name) { return *folder_ / name; }
  static std::string bytes(const std::string& name) { return read_text_file(path(name), 1 << 26); }
  static nlohmann::ordered_json json(const std::string& name) {
    return nlohmann::ordered_json::parse(bytes(name));
  }

  static inline std::unique_ptr<TemporaryFolder> folder_;
};

/// A test with a folder of its own.
class ProgramTest : public WithFolder {
 protected:
  ProgramTest() { folder_ = std::make_unique<TemporaryFolder>(); }
  ~ProgramTest() override { folder_.reset(); }
};

/// A small simulated data set that all tests of a suite share: one pass of each of two trials over 3_Bumps
/// lie in path("data").
class OnSimulatedData : public WithFolder {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    succeed("supertac-simulate --out data --plates 3_Bumps --speeds 10 --passes 1");
  }
  static void TearDownTestSuite() { folder_.reset(); }
};

/// A small training on simulated data, for tests of what becomes of it.
class Training : public OnSimulatedData {
 protected:
  /// Of a small model in seconds; an option that is given again replaces the one before.
  static std::string options(const std::string& out, const std::string& more = "") {
    return " --data data --out " + out +
           " --timesteps 32 --latent 3 --scale 2 --batch 8 --stride 8 --epochs 2 " + more;
  }
  static ProcessResult train(const std::string& out, const std::string& more = "") {
    return run("supertac-train" + options(out, more));
  }
  /// train() that has to succeed.
  static ProcessResult trained(const std::string& out, const std::string& more = "") {
    return succeed("supertac-train" + options(out, more));
  }
};

}  // namespace supertac
