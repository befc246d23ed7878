// The fuzzers' corpora as regression tests, in every build.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/fuzz/frame_decoder_properties.h"
#include "tests/fuzz/journal_properties.h"
#include "tests/fuzz/marlin_reply_properties.h"

namespace supertac {
namespace {

/// Runs `check` on every file of a corpus. Returns how many there were
int replay(const std::string& corpus, void (*check)(std::span<const std::byte>)) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SUPERTAC_FUZZ_CORPUS "/" + corpus)) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    EXPECT_NO_THROW(check(std::as_bytes(std::span(text)))) << entry.path();
    ++files;
  }
  return files;
}

TEST(FuzzCorpus, FrameDecoder) { EXPECT_GT(replay("frame_decoder", check_frame_decoder), 10); }

TEST(FuzzCorpus, MarlinReplies) { EXPECT_GT(replay("marlin_reply", check_marlin_replies), 10); }

TEST(FuzzCorpus, Journals) { EXPECT_GT(replay("journal", check_journal), 10); }

}  // namespace
}  // namespace supertac
