#include "hardware/collection/journal.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/clock.h"
#include "tests/hardware/rig_support.h"
#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::journal_test {

std::vector<std::byte> file_bytes(const std::string& path) { return read_file(path, 1 << 30); }

// The bytes of a journal that `write` was given to fill.
std::vector<std::byte> journal_of(const std::function<void(JournalWriter&)>& write) {
  const TemporaryFolder folder;
  JournalWriter writer(folder / "j", "h");
  write(writer);
  writer.close();
  return file_bytes(folder / "j");
}

TEST(Journal, GivesBackWhatWasWritten) {
  const std::vector<std::byte> bytes = journal_of([](JournalWriter& writer) {
    writer.append(JournalStream::board, RecordKind::received, 1.5, frame_bytes(random_frame(1)));
    writer.event(2.5, "something");
  });
  const Journal journal = parse_journal(bytes, "j");
  EXPECT_EQ(journal.header, "h");
  ASSERT_EQ(journal.of(JournalStream::board).size(), 1U);
  EXPECT_EQ(journal.of(JournalStream::board)[0].time_s, 1.5);
  EXPECT_EQ(journal.of(JournalStream::board)[0].bytes, frame_bytes(random_frame(1)));
  EXPECT_EQ(journal.of(JournalStream::event)[0].text(), "something");
  EXPECT_EQ(journal.torn_bytes, 0U);
  EXPECT_TRUE(journal.of(JournalStream::printer).empty());
}

TEST(Journal, NeverOverwritesAndSaysWhyItCannotWrite) {
  const TemporaryFolder folder;
  std::ofstream(folder / "j") << "precious";
  EXPECT_ERROR(
      JournalWriter(folder / "j", ""), JournalError,
      "cannot be created: File exists; recover it with supertac-import --journal, or choose another folder");
  EXPECT_EQ(file_bytes(folder / "j").size(), 8U);
  EXPECT_ERROR(JournalWriter(folder / "no/such/folder", ""), JournalError,
               "cannot be created: No such file or directory; choose a folder that can be written");
}

TEST(Journal, EveryPrefixReadsAsFarAsItIsWhole) {
  const std::vector<std::byte> whole = journal_of([](JournalWriter& writer) {
    for (int i = 0; i < 20; ++i) writer.event(1e-3 * i, "event " + std::to_string(i));
  });
  const std::size_t head = 24 + 13 + 1;
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    const auto prefix = std::span(whole).first(length);
    if (length < head) {
      EXPECT_ERROR(parse_journal(prefix, "j"), JournalError,
                   "journal j: expected a SuperTac journal, found other bytes or a damaged beginning");
    } else {
      const Journal journal = parse_journal(prefix, "j");
      EXPECT_EQ(journal.torn_bytes,
                length == whole.size() ? 0 : length - (length < 2 * head ? head : 2 * head));
    }
  }
}

TEST(Journal, EveryFlippedBitIsFound) {
  const std::vector<std::byte> whole = journal_of([](JournalWriter& writer) { writer.event(1, "first"); });
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::vector<std::byte> damaged = whole;
    damaged[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    const Journal journal = parse_journal(damaged, "j");
    const std::uint64_t header = 2 * (24 + 13 + 1);
    EXPECT_GT(journal.lost_bytes + journal.torn_bytes, 0U) << "bit " << bit;
    EXPECT_EQ(journal.header, "h") << "it stands there twice, bit " << bit;
    EXPECT_EQ(journal.of(JournalStream::event).size(), bit / 8 < header ? 1U : 0U) << "bit " << bit;
  }
}

TEST(Journal, TenFlippedBitsCostTheirOwnChunksOnly) {
  constexpr int kFrames = 12'000;
  const std::vector<std::byte> whole = journal_of([](JournalWriter& writer) {
    for (int i = 0; i < kFrames; ++i)
      writer.append(JournalStream::board, RecordKind::received, 100 + 1e-3 * i, frame_bytes(random_frame(1)));
  });
  // Two copies of 24 + 13 + 1 bytes. One bit in each would cost everything, and how long the file is, and so
  // where a random bit lies, depends on when the writer's thread woke.
  constexpr std::size_t kHeaders = 76;
  double worst = 1;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    std::vector<std::byte> damaged = whole;
    const RandomStream random(seed, 1);
    for (std::uint64_t flip = 0; flip < 10; ++flip) {
      // The first of them in a header, where it once cost everything.
      const std::size_t at = flip == 0 ? random.bits(flip) % kHeaders
                                       : kHeaders + random.bits(flip) % (damaged.size() - kHeaders);
      damaged[at] ^= static_cast<std::byte>(1U << (random.bits(flip + 100) % 8));
    }
    const Journal journal = parse_journal(damaged, "j");
    worst = std::min(worst, static_cast<double>(journal.of(JournalStream::board).size()) / kFrames);
    EXPECT_GT(journal.lost_bytes, 0U);
    EXPECT_GT(journal.lost_s, 0.005);
    EXPECT_LT(journal.lost_s, 0.2);
  }
  EXPECT_GE(worst, 0.99);
}

TEST(Journal, BeginningsOfChunksWithoutEndTakeNoTime) {
  std::vector<std::byte> bytes = journal_of([](JournalWriter&) {});
  const std::vector<std::byte> head(bytes.begin(), bytes.begin() + 24);
  while (bytes.size() < (4 << 20)) {
    bytes.insert(bytes.end(), head.begin(), head.end());
    const std::uint32_t length = (2 << 20);
    memcpy(&bytes[bytes.size() - 16], &length, sizeof length);
  }
  const double begin = seconds_of(CLOCK_THREAD_CPUTIME_ID);  // hours where every one is read to its end
  EXPECT_EQ(parse_journal(bytes, "j").header, "h");
  EXPECT_LT(seconds_of(CLOCK_THREAD_CPUTIME_ID) - begin, 20);
}

TEST(Journal, AFullDiskIsReportedAndWhatWasWrittenIsKept) {
  const TemporaryFolder folder;
  {
    const FaultInjection full(10, ENOSPC, true);  // behind the two headers
    JournalWriter writer(folder / "j", "h");
    const auto write_on = [&] {
      for (int i = 0; i < 20'000; ++i, usleep(10'000)) writer.event(i, "more"), writer.check();
    };
    EXPECT_ERROR(write_on(), JournalError, "make room or change the disk and start again");
  }
  EXPECT_EQ(read_journal(folder / "j").header, "h");
}

// How much of the newest a kill costs is in bench/results/rig/kill.csv. What was written is a whole
// beginning.
TEST(Journal, WhatIsAppendedReachesTheFileByItselfAndAKillLeavesAWholeBeginning) {
  const TemporaryFolder folder;
  for (std::uintmax_t round = 1; round <= 6; ++round) {
    const std::string path = folder / ("j" + std::to_string(round));
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      JournalWriter writer(path, "h");
      for (int tick = 0;; ++tick, usleep(1000)) writer.event(monotonic_seconds(), std::to_string(tick));
    }
    std::error_code missing;
    for (int i = 0; i < 100'000 && !(std::filesystem::file_size(path, missing) > 4000 * round && !missing);
         ++i)
      usleep(1000);
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const auto events = read_journal(path).of(JournalStream::event);
    ASSERT_GT(events.size(), 50 * round);
    for (std::size_t tick = 0; tick < events.size(); ++tick)
      ASSERT_EQ(events[tick].text(), std::to_string(tick));
  }
}

}  // namespace supertac::journal_test
