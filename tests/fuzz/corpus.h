// What a fuzzer has kept, as regression test. A case is a line "LENGTH NAME" and LENGTH bytes.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <fstream>
#include <span>
#include <string>

namespace supertac {

/// Runs `check` on every case of corpus/NAME.pack; one that throws fails the test by name. Returns how many
/// there were.
inline int replay(const std::string& name, void (*check)(std::span<const std::byte>)) {
  std::ifstream file(SUPERTAC_FUZZ_CORPUS "/" + name + ".pack", std::ios::binary);
  int cases = 0;
  std::size_t length = 0;
  for (std::string label; file >> length && std::getline(file, label); ++cases) {
    std::string bytes(length, '\0');
    if (!file.read(bytes.data(), static_cast<std::streamsize>(length)))
      ADD_FAILURE() << name << " is cut at" << label;
    EXPECT_NO_THROW(check(std::as_bytes(std::span(bytes)))) << name << label;
  }
  EXPECT_TRUE(file.eof()) << name << ": expected \"LENGTH NAME\" after case " << cases;
  return cases;
}

}  // namespace supertac
