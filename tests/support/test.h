// What nearly every test needs: GoogleTest, the standard library's everyday headers, errors with their text
// (a type says what a program does next, its text what a person does), and a folder of its own.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

/// what() of the `Error` that `action` throws.
template <class Error>
std::string what_of(const auto& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

/// The statement behind the text throws std::invalid_argument with exactly this text.
#define EXPECT_REFUSAL(text, ...) EXPECT_EQ(what_of<std::invalid_argument>([&] { __VA_ARGS__; }), text)

/// `statement` throws `Type`, and `part` stands in its what(), which is one line.
#define EXPECT_ERROR(statement, Type, part)                        \
  EXPECT_THROW(                                                    \
      {                                                            \
        try {                                                      \
          statement;                                               \
        } catch (const std::exception& error_) {                   \
          const std::string what_ = error_.what();                 \
          EXPECT_NE(what_.find(part), std::string::npos) << what_; \
          EXPECT_EQ(what_.find('\n'), std::string::npos) << what_; \
          throw;                                                   \
        }                                                          \
      },                                                           \
      Type)

namespace supertac {

/// A folder of its own for one test, removed at its end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    const bool memory = access("/dev/shm", W_OK) == 0;  // hundreds of thousands of small writes
    path_ = (memory ? "/dev/shm" : std::filesystem::temp_directory_path().string()) + "/supertac-test-XXXXXX";
    if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("cannot create " + path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string file(const std::string& name) const { return path_ + "/" + name; }
  std::string operator/(const std::string& name) const { return file(name); }
  std::size_t entries() const {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path_)) ++count;
    return count;
  }

 private:
  std::string path_;
};

}  // namespace supertac
