// supertac-train under mpirun: the same bytes as alone, and an end with one line when a rank ends.
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>

#include <chrono>
#include <fstream>
#include <sstream>

#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::models_ranks_test {

namespace fs = std::filesystem;

std::string content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

class Mpi : public Training {
 protected:
  Mpi() {  // what Open MPI asks for on two processors, and of root
    for (const char* name :
         {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"})
      ::setenv(name, "1", 1);
    ::setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 1);
  }
  static std::string options(const std::string& out, const std::string& more = "") {
    return Training::options(path(out), "--checkpoint-every 5 --threads 1 --epochs 3 " + more);
  }
  static std::string ranks(int count, const std::string& options, const std::string& before = "") {
    return " -n " + std::to_string(count) + " " + before + " " SUPERTAC_BIN "/supertac-train" + options;
  }
  static ProcessResult mpirun(const std::string& ranks, const ProcessOptions& how = {}) {
    return run(SUPERTAC_MPIRUN + ranks, how);
  }

  /// The lines of ours: mpirun adds some of its own.
  static std::vector<std::string> lines(const ProcessResult& result) {
    std::vector<std::string> lines;
    std::istringstream text(result.error);
    for (std::string line; std::getline(text, line);)
      if (line.starts_with("supertac")) lines.push_back(line);
    return lines;
  }
  static void expect_one_line(const ProcessResult& result, const std::string& part) {
    EXPECT_NE(result.code, 0);
    const std::vector<std::string> all = lines(result);
    ASSERT_EQ(all.size(), 1u) << result.error;
    EXPECT_TRUE(contains(all[0], part));
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
    RunningProcess run = start(SUPERTAC_MPIRUN + ranks(4, options(name + ".safetensors", "--epochs 400")));
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
    succeed("supertac-info " + state);
    return result;
  }
};

TEST_F(Mpi, TheSameBytesAsAlone) {
  succeed("supertac-train" + options("alone.safetensors"));
  const std::string alone = bytes("alone.safetensors") + bytes("alone.run/last.safetensors");
  for (const int count : {1, 2, 4}) {
    const std::string name = "by" + std::to_string(count);
    succeed(SUPERTAC_MPIRUN + ranks(count, options(name + ".safetensors")));
    EXPECT_TRUE(alone == bytes(name + ".safetensors") + bytes(name + ".run/last.safetensors")) << count;
  }
  const std::string mixed = options("mixed.safetensors");
  succeed(SUPERTAC_MPIRUN + ranks(1, mixed, "env SUPERTAC_ISA=portable") + " :" + ranks(1, mixed));
  EXPECT_TRUE(alone == bytes("mixed.safetensors") + bytes("mixed.run/last.safetensors"))
      << "two instruction sets";
}

TEST_F(Mpi, StoppedByFourAndResumedByTwo) {
  const std::string longer = "--epochs 12";
  succeed("supertac-train" + options("whole.safetensors", longer));
  const std::string state = path("part.run/last.safetensors");
  const ProcessResult cut =
      mpirun(ranks(4, options("part.safetensors", longer)), {.signal = SIGTERM, .signal_when = state});
  EXPECT_NE(cut.code, 0);
  EXPECT_FALSE(fs::exists(path("part.safetensors")));
  succeed(SUPERTAC_MPIRUN + ranks(2, options("part.safetensors", longer + " --resume " + state)));
  EXPECT_TRUE(bytes("whole.safetensors") == bytes("part.safetensors"));
}

TEST_F(Mpi, ANumberThatCannotShareTheMicroBatchesAndARankWithAnotherOptionAreNamed) {
  const auto with = [](const std::string& more) { return options("odd.safetensors", more); };
  expect_one_line(mpirun(ranks(3, with(""))), "3 processes cannot share the 8 micro-batches of a batch of ");
  expect_one_line(mpirun(ranks(1, with("")) + " :" + ranks(1, with("--beta 0.5"))),
                  "rank 1: its training is");
  expect_one_line(mpirun(ranks(3, with("")) + " :" + ranks(1, with("--data none"))), "rank 3");
  EXPECT_FALSE(fs::exists(path("odd.run")));
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

}  // namespace supertac::models_ranks_test
