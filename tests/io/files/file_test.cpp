#include "io/files/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::file_test {

constexpr std::uint64_t kPlenty = 1 << 20;
const std::string kOld = "the old content";
const std::string kNew(10'000, 'n');

std::string error_of(const auto& action) { return what_of<FileError>(action); }

/// Replaces a file in three parts.
void replace(const std::string& path) {
  AtomicFile file(path);
  file.write(kNew.substr(0, 10));
  file.write(kNew.substr(10, 5000));
  file.write(kNew.substr(5010));
  file.commit();
}

TEST(File, WritesAndReadsBack) {
  TemporaryFolder folder;
  const std::string path = folder.file("a");
  write_file(path, kNew);
  EXPECT_EQ(read_text_file(path, kPlenty), kNew);
  write_file(path, "");
  EXPECT_EQ(read_text_file(path, kPlenty), "");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(File, AppearsBesideWhatTookItsName) {
  TemporaryFolder folder;
  std::string said;
  const OutputPath output(folder.file("a.txt"), [&said](const std::string& line) { said = line; });
  write_file(output, "first");
  EXPECT_EQ(said, "");
  write_file(output, "second");
  EXPECT_EQ(said, folder.file("a.txt") + ": appeared meanwhile and is not replaced; what was made is " +
                      folder.file("a-2.txt"));
  std::filesystem::remove(folder.file("a.txt"));
  std::filesystem::create_symlink("b", folder.file("a.txt"));  // that leads nowhere
  write_file(output, "third");
  EXPECT_FALSE(std::filesystem::exists(folder.file("b")));
  std::filesystem::remove(folder.file("a.txt"));
  std::filesystem::create_directory(folder.file("a.txt"));
  write_file(output, "fourth");
  for (const auto& [name, text] :
       {std::pair{"a-2.txt", "second"}, {"a-3.txt", "third"}, {"a-4.txt", "fourth"}})
    EXPECT_EQ(read_text_file(folder.file(name), kPlenty), text);
  EXPECT_EQ(folder.entries(), 4U);
}

// Models, folders and captures are renamed by it.
TEST(File, APublishedNameIsSyncedAndAFailedSyncSaysThatItIsThere) {
  const TemporaryFolder folder;
  write_file(folder.file("done"), kNew);
  {
    FaultInjection record(1 << 30, 0, false);  // only listens
    EXPECT_EQ(publish(folder.file("done"), folder.file("a")), folder.file("a"));
    const std::vector<std::string> expected = {"rename", "open", "fsync", "close"};
    EXPECT_EQ(FaultInjection::calls(), expected);
  }
  FaultInjection injection(3, EIO, false);
  EXPECT_EQ(error_of([&] { publish(folder.file("a"), folder.file("b")); }),
            folder.file("b") +
                ": cannot sync the directory (it is written, a power cut may yet lose it): "
                "Input/output error; check the disk");
  EXPECT_EQ(read_text_file(folder.file("b"), kPlenty), kNew);
}

TEST(File, LeavesNothingWithoutCommitAndNoDescriptorOpen) {
  const TemporaryFolder folder;
  const auto descriptors = [] {
    const std::filesystem::directory_iterator all("/proc/self/fd");
    return std::distance(begin(all), end(all));
  };
  const auto before = descriptors();
  { AtomicFile(folder.file("dropped")).write(kNew); }
  EXPECT_EQ(folder.entries(), 0U);
  AtomicFile kept(folder.file("kept"));
  kept.commit();
  EXPECT_EQ(descriptors(), before);
  EXPECT_THROW(kept.commit(), std::invalid_argument);
}

// A child that ends in mid-write, as after kill -9, leaves its temporary; the next writer of that file sweeps
// it, and nothing else.
TEST(File, SweepsWhatAKilledWriterLeft) {
  TemporaryFolder folder;
  const std::string path = folder.file("a");
  const pid_t child = fork();
  if (child == 0) {
    AtomicFile file(path);
    file.write(kNew);
    _exit(0);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  ASSERT_EQ(folder.entries(), 1u);
  write_file(folder.file("b"), kOld);
  EXPECT_EQ(folder.entries(), 2u) << "the leftover is of another file";
  const std::string own = std::to_string(getpid()), dead = std::to_string(child);
  const std::vector<std::string> kept = {"a.tmp-" + own + "-x",
                                         "a.tmp-1-0",
                                         "a.tmp-",
                                         "a.tmp-x-0",
                                         "a.tmpx" + dead,
                                         "aa.tmp-" + dead + "-0",
                                         "a.tmp-0-0",
                                         "a.tmp-99999999999999999999-0"};
  for (const std::string& name : kept) std::ofstream(folder.file(name)) << "x";
  write_file(path, kOld);
  EXPECT_EQ(folder.entries(), kept.size() + 2) << "a, b, and all that may still be somebody's";
  for (const std::string& name : kept) EXPECT_TRUE(std::filesystem::exists(folder.file(name))) << name;
}

TEST(File, ErrorsNameFileAndReason) {
  TemporaryFolder folder;
  const std::string path = folder.file("a");
  EXPECT_EQ(error_of([&] { read_file(path, kPlenty); }),
            path + ": cannot open the file: No such file or directory; check the name");
  EXPECT_ERROR(read_file(folder.path(), kPlenty), FileError, "is a directory");
  EXPECT_ERROR(write_file(folder.path(), "x"), FileError, "not a regular file");
  EXPECT_ERROR(write_file(folder.file("no/where"), "x"), FileError, "create a file in");
  write_file(path, "12345");
  EXPECT_ERROR(read_file(path, 4), FileError, "has 5 bytes, expected at most 4");
  ASSERT_EQ(mkfifo(folder.file("pipe").c_str(), 0600), 0);
  EXPECT_ERROR(read_file(folder.file("pipe"), kPlenty), FileError, "not a regular file")
      << "it has no writer";
}

TEST(File, SaysWhenItIsShortenedWhileRead) {
  TemporaryFolder folder;
  const std::string path = folder.file("a");
  write_file(path, kNew);
  FileReader reader(path);
  std::vector<std::byte> half(5000);
  reader.read(half);
  ASSERT_EQ(truncate(path.c_str(), 6000), 0);
  EXPECT_ERROR(reader.read(half), FileError, "ends after 6000 bytes, expected 10000");
}

TEST(File, SymbolicLinkStays) {
  TemporaryFolder folder;
  write_file(folder.file("target"), kOld);
  std::filesystem::create_symlink("target", folder.file("link"));
  write_file(folder.file("link"), kNew);
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("link")));
  EXPECT_EQ(read_text_file(folder.file("target"), kPlenty), kNew);
}

TEST(File, RefusesExistingWithoutForce) {
  TemporaryFolder folder;
  const std::string path = folder.file("a");
  EXPECT_NO_THROW(refuse_existing(path, false));
  write_file(path, "x");
  EXPECT_NO_THROW(refuse_existing(path, true));
  EXPECT_EQ(error_of([&] { refuse_existing(path, false); }),
            path + ": exists already; choose another name or pass --force to replace it");
}

/// Lets every call of a replacement fail in turn; returns how many runs threw.
int fail_each_call(int error, bool forever) {
  int thrown = 0;
  for (int at = 1;; ++at) {
    TemporaryFolder folder;
    const std::string path = folder.file("a");
    write_file(path, kOld);
    std::string message;
    bool reached = false;
    {
      FaultInjection injection(at, error, forever);
      message = error_of([&] { replace(path); });
      reached = FaultInjection::reached();
    }
    const bool failed = message != "nothing thrown";
    const bool in_place = !failed || message.find("sync the directory") != std::string::npos;
    EXPECT_EQ(read_text_file(path, kPlenty), in_place ? kNew : kOld) << "call " << at << ": " << message;
    EXPECT_EQ(folder.entries(), 1u) << "call " << at;
    thrown += failed;
    if (!reached) return thrown;
  }
}

TEST(FileFaults, EveryCallFailsOnceAndForEver) {
  for (const int error : {ENOSPC, EIO, EDQUOT}) {
    // open temporary, 3 writes, fsync, close, rename, open directory, fsync directory; its close may fail. A
    // failed fsync is not tried again, or one run would come through.
    EXPECT_EQ(fail_each_call(error, false), 9);
    EXPECT_EQ(fail_each_call(error, true), 9);
  }
}

TEST(FileFaults, InterruptedCallsAreRepeated) {
  EXPECT_EQ(fail_each_call(EINTR, false), 1);  // rename never is
}

TEST(FileFaults, ShortWritesAndReadsAreContinued) {
  for (int at = 1; at < 30; ++at) {
    TemporaryFolder folder;
    FaultInjection injection(at, 0, true, Fault::short_count);
    replace(folder.file("a"));
    EXPECT_EQ(read_text_file(folder.file("a"), kPlenty), kNew);
  }
}

TEST(FileFaults, EveryReadCallFails) {
  for (int at = 1; at <= 3; ++at) {
    TemporaryFolder folder;
    write_file(folder.file("a"), kNew);
    FaultInjection injection(at, EIO, false);
    EXPECT_ERROR(read_file(folder.file("a"), kPlenty), FileError, "check the disk");
  }
}

// After a power cut data not yet synced may be there, torn or gone, and a rename not yet synced may or may
// not have reached the disk: so the data is synced before the rename, and the folder after it.
TEST(FileCrash, AlwaysOldOrNew) {
  TemporaryFolder folder;
  FaultInjection record(1 << 30, 0, false);  // only listens
  replace(folder.file("a"));
  const std::vector<std::string> expected = {"open",  "write",  "write", "write", "fsync",
                                             "close", "rename", "open",  "fsync", "close"};
  EXPECT_EQ(FaultInjection::calls(), expected);
}

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
    for (int at = 1; at <= 2; ++at) {
      ScratchFile file;
      std::vector<float> all(1000);
      const FaultInjection injection(at, ENOSPC, false, fault);
      const auto use = [&] { file.append(numbers(1000, 0)), file.read(0, all); };
      if (fault == Fault::error) {
        EXPECT_ERROR(use(), FileError, "set TMPDIR to a folder on a disk with room");
      } else {
        EXPECT_NO_THROW(use());
        EXPECT_EQ(all, numbers(1000, 0));
      }
    }
  ::setenv("TMPDIR", folder_.file("nowhere").c_str(), 1);
  EXPECT_ERROR(ScratchFile(), FileError, "nowhere: cannot make a temporary file there: No such file");
}

}  // namespace supertac::file_test
