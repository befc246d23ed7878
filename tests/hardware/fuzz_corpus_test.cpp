// The fuzzer's corpus as a regression test, in every build.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/fuzz/frame_decoder_properties.h"

namespace supertac {
namespace {

TEST(FuzzCorpus, FrameDecoder) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SUPERTAC_FUZZ_CORPUS "/frame_decoder")) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    EXPECT_NO_THROW(check_frame_decoder(std::as_bytes(std::span(text)))) << entry.path();
    ++files;
  }
  EXPECT_GT(files, 10);
}

}  // namespace
}  // namespace supertac
