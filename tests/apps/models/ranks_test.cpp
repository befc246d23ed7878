// supertac-train under mpirun: the same bytes as alone, and an end with one line whatever happens to a rank.
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

std::string content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

class Mpi : public OnSimulatedData {
 protected:
  Mpi() {  // what Open MPI asks for on two processors, and of root
    for (const char* name :
         {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"})
      ::setenv(name, "1", 1);
    ::setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 1);
  }
  static Words options(const std::string& out, const Words& more = {}) {
    Words all{"--data",  path("data"), "--timesteps",
              "32",      "--latent",   "3",
              "--scale", "2",          "--batch",
              "8",       "--stride",   "8",
              "--out",   path(out),    "--checkpoint-every",
              "5",       "--threads",  "1"};
    if (std::find(more.begin(), more.end(), "--epochs") == more.end())
      all.insert(all.end(), {"--epochs", "3"});
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  static Words ranks(int count, const Words& arguments, const Words& before = {}) {
    Words all{"-n", std::to_string(count)};
    all.insert(all.end(), before.begin(), before.end());
    all.push_back(std::string(SUPERTAC_BIN) + "/supertac-train");
    all.insert(all.end(), arguments.begin(), arguments.end());
    return all;
  }
  static Words both(Words a, const Words& b) {
    a.push_back(":");
    a.insert(a.end(), b.begin(), b.end());
    return a;
  }
  static ProcessResult mpirun(const Words& words, const ProcessOptions& how = {}) {
    return run_process(SUPERTAC_MPIRUN, words, how);
  }
  /// The lines of ours: mpirun adds some of its own.
  static Words lines(const ProcessResult& result) {
    Words lines;
    std::istringstream text(result.error);
    for (std::string line; std::getline(text, line);)
      if (line.starts_with("supertac")) lines.push_back(line);
    return lines;
  }
  static void expect_one_line(const ProcessResult& result, const std::string& part) {
    EXPECT_NE(result.code, 0);
    const Words all = lines(result);
    ASSERT_EQ(all.size(), 1u) << result.error;
    EXPECT_NE(all[0].find(part), std::string::npos) << all[0];
  }
  /// The process of that rank which writes to `out`; 0 = none.
  static pid_t process_of(const std::string& out, int rank) {
    for (const auto& entry : fs::directory_iterator("/proc")) {
      const std::string environment = content_of(entry.path() / "environ");
      const std::string command = content_of(entry.path() / "cmdline");
      const std::size_t space = command.find('\0');
      if (!command.substr(0, space).ends_with("supertac-train") || command.find(out) == std::string::npos)
        continue;
      for (const char* name : {"OMPI_COMM_WORLD_RANK=", "PMI_RANK="})
        if (environment.find(name + std::to_string(rank) + '\0') != std::string::npos)
          return std::stoi(entry.path().filename());
    }
    return 0;
  }
  /// Does `harm` to that rank of four in mid-training; the run ends in time, and its state stays whole.
  static ProcessResult lose(int rank, const std::string& name, const std::function<void(pid_t)>& harm) {
    RunningProcess run(SUPERTAC_MPIRUN,
                       ranks(4, options(name + ".safetensors", {"--epochs", "400", "--deadline", "4"})));
    const std::string state = path(name + ".run/last.safetensors");
    wait_for_file(state);
    const pid_t process = process_of(path(name), rank);
    EXPECT_GT(process, 0);
    if (process > 0) harm(process);
    const auto begin = std::chrono::steady_clock::now();
    ProcessResult result = run.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
    EXPECT_NE(result.code, 0);
    EXPECT_LE(lines(result).size(), 1u) << result.error;
    EXPECT_EQ(run_process("supertac-info", {state}).code, 0);
    return result;
  }
};

TEST_F(Mpi, TheSameBytesAsAlone) {
  ASSERT_EQ(run_process("supertac-train", options("alone.safetensors")).code, 0);
  const std::string alone = bytes("alone.safetensors") + bytes("alone.run/last.safetensors");
  for (const int count : {1, 2, 4}) {
    const std::string name = "by" + std::to_string(count);
    const ProcessResult result = mpirun(ranks(count, options(name + ".safetensors")));
    ASSERT_EQ(result.code, 0) << result.error;
    EXPECT_TRUE(alone == bytes(name + ".safetensors") + bytes(name + ".run/last.safetensors")) << count;
  }
  const ProcessResult mixed =
      mpirun(both(ranks(1, options("mixed.safetensors"), {"env", "SUPERTAC_ISA=portable"}),
                  ranks(1, options("mixed.safetensors"))));
  ASSERT_EQ(mixed.code, 0) << mixed.error;
  EXPECT_TRUE(alone == bytes("mixed.safetensors") + bytes("mixed.run/last.safetensors"))
      << "two instruction sets";
}

TEST_F(Mpi, StoppedByFourAndResumedByTwo) {
  const Words longer{"--epochs", "12"};
  ASSERT_EQ(run_process("supertac-train", options("whole.safetensors", longer)).code, 0);
  const std::string state = path("part.run/last.safetensors");
  const ProcessResult cut =
      mpirun(ranks(4, options("part.safetensors", longer)), {.signal = SIGTERM, .signal_when = state});
  EXPECT_NE(cut.code, 0);
  EXPECT_FALSE(fs::exists(path("part.safetensors")));
  const ProcessResult resumed =
      mpirun(ranks(2, options("part.safetensors", {"--epochs", "12", "--resume", state})));
  ASSERT_EQ(resumed.code, 0) << resumed.error;
  EXPECT_TRUE(bytes("whole.safetensors") == bytes("part.safetensors"));
}

TEST_F(Mpi, NumbersThatCannotShareTheLanesAreRefused) {
  expect_one_line(mpirun(ranks(3, options("three.safetensors"))),
                  "3 processes cannot share the 8 micro-batches of a batch of ");
  EXPECT_FALSE(fs::exists(path("three.run")));
}

TEST_F(Mpi, ARankWithAnotherOptionIsNamed) {
  expect_one_line(mpirun(both(ranks(1, options("odd.safetensors")),
                              ranks(1, options("odd.safetensors", {"--beta", "0.5"})))),
                  "rank 1: its training is");
  expect_one_line(mpirun(both(ranks(3, options("odd.safetensors")),
                              ranks(1, options("odd.safetensors", {"--data", path("none")})))),
                  "rank 3");
  EXPECT_FALSE(fs::exists(path("odd.run")));
}

TEST_F(Mpi, AFrozenRankIsNamed) {
  for (const int rank : {0, 2})
    expect_one_line(lose(rank, "frozen" + std::to_string(rank), [](pid_t p) { kill(p, SIGSTOP); }),
                    "rank " + std::to_string(rank) + " of 4 has not answered");
}

// The first rank waits for the other in MPI_Init, and its own alarm reaches it when all is over.
TEST_F(Mpi, ARankFrozenAtTheStartIsOneLine) {
  const Words mine = options("start.safetensors", {"--deadline", "3"});
  std::string late = "sleep 4; exec " SUPERTAC_BIN "/supertac-train";
  for (const std::string& word : mine) late += " '" + word + "'";
  RunningProcess run(SUPERTAC_MPIRUN, both(ranks(1, mine), {"-n", "1", "sh", "-c", late}));
  const auto begin = std::chrono::steady_clock::now();
  pid_t first = 0;
  while (first == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(3))
    first = process_of(path("start"), 0);
  ASSERT_GT(first, 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  kill(first, SIGSTOP);
  expect_one_line(run.wait(), "not all processes of mpirun came to start");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
}

// The other rank has ended well, and mpirun waits for this one without a deadline.
TEST_F(Mpi, ARankFrozenAtTheEndIsOneLine) {
  const auto begin = std::chrono::steady_clock::now();
  const std::string preload = "LD_PRELOAD=" SUPERTAC_FREEZE_AT_END;
  Words words = ranks(2, options("end.safetensors", {"--epochs", "1", "--deadline", "2"}));
  words.insert(words.begin() + 2, {"env", preload});
  expect_one_line(mpirun(words), "all is written, but a process of mpirun did not end within the deadline");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
  EXPECT_EQ(run_process("supertac-info", {path("end.safetensors")}).code, 0);
}

TEST_F(Mpi, AKilledRankEndsAll) {
  lose(1, "killed", [](pid_t p) { kill(p, SIGKILL); });
}

TEST_F(Mpi, ADiskThatIsFullOnTheFirstRankIsOneLine) {
  const ProcessResult result = lose(0, "full", [](pid_t p) {
    const rlimit limit{60'000, 60'000};
    EXPECT_EQ(prlimit(p, RLIMIT_FSIZE, &limit, nullptr), 0);
  });
  expect_one_line(result, "last.safetensors");
}

}  // namespace
}  // namespace supertac
