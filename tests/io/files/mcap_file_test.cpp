// tests/python/tools_test.py opens what supertac-stream writes in the public readers, by the index and with
// all sums checked; here stands the hash of a file that one of them (mcap 1.6 of PyPI) has read as it was
// written: all messages in order, those of a topic and a time, every entry of its indexes, without the
// summary too.
#include "io/files/mcap_file.h"

#include "io/numbers/hash.h"
#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::mcap_file_test {

const std::vector<McapChannel> kChannels = {{"/a", "A", "float32 y\n", {{"unit", "V"}}},
                                            {"/b", "B", "float32 x\n"}};

// Of two channels in several chunks, whose times do not rise.
TEST(McapFile, HasTheBytesThatThePublicReaderTook) {
  const TemporaryFolder folder;
  McapFile file(folder / "a.mcap", kChannels);
  for (std::uint64_t i = 0; i < 300; ++i)
    file.add(i % 3 == 0, 1000 + 10 * (i ^ 1U), i, std::string(10 * i, static_cast<char>('a' + i % 26)));
  file.close();
  EXPECT_EQ(sha256(read_text_file(folder / "a.mcap", 1 << 24)),
            "d94ac3ef8c3f17f7e5bb21da0977fa9ca99b0e76fd90c798f6ef6fbe6cd85100");
}

TEST(McapFile, WithoutMessagesIsWholeToo) {
  const TemporaryFolder folder;
  McapFile file(folder / "a.mcap", kChannels);
  EXPECT_THROW(read_file(folder / "a.mcap", 100), FileError);  // not before it is complete
  file.close();
  EXPECT_FALSE(read_file(folder / "a.mcap", 4096).empty());
}

// One chunk that was not written would be missing without a word.
TEST(McapFile, AfterAFailedWriteThereIsNoFile) {
  const TemporaryFolder folder;
  {
    const FaultInjection fault(4, ENOSPC, false);  // open, open, write the channels, write a chunk
    McapFile file(folder / "a.mcap", kChannels);
    EXPECT_THROW(file.add(0, 1, 1, std::string(300'000, 'x')), FileError);
    EXPECT_NO_THROW(file.add(0, 2, 2, "y"));
    EXPECT_THROW(file.close(), FileError);
  }
  EXPECT_EQ(folder.entries(), 0U);
}

}  // namespace supertac::mcap_file_test
