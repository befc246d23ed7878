#include "apps/ranks/mpi_ranks.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <thread>

#include "apps/common/running/signals.h"
#include "io/numbers/clock.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr int kDataTag = 1, kNewsTag = 2;
constexpr char kHere = 'H', kLeft = 'L';
constexpr std::size_t kMostText = 1000;  // sent at once by every MPI, whether or not it is received
constexpr double kHurriedS = 0.15;       // mpirun kills a second after its signal
constexpr int kApartS = 3;               // from one rank's alarm to the next: mpirun ends all meanwhile
constexpr double kAfterAlarmsS = 6;      // those of the first two ranks; 30 s in all with the usual deadline

std::chrono::steady_clock::duration seconds(double s) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

// When the alarm is due, in seconds of the monotonic clock.
volatile double alarm_due_s = 0;

// A process that was frozen gets its alarm when the others have ended and said why, so it says nothing.
void not_together(int) {
  constexpr double kLateS = 0.8;
  if (seconds_of(CLOCK_MONOTONIC) > alarm_due_s + kLateS) _exit(1);
  static const char kText[] =
      "supertac: not all processes of mpirun came to start and to end together within the deadline; start "
      "again\n";
  (void)!write(STDERR_FILENO, kText, sizeof kText - 1);
  _exit(1);
}

// MPI_Init and MPI_Finalize wait for all processes and know no deadline. The first rank is the first to give
// up, and mpirun then ends the others.
class Alarm {
 public:
  Alarm(double deadline_s, int rank) {
    std::signal(SIGALRM, not_together);
    const unsigned wait_s =
        static_cast<unsigned>(std::min(deadline_s, 1e6)) + static_cast<unsigned>(kApartS * rank);
    alarm_due_s = seconds_of(CLOCK_MONOTONIC) + wait_s;
    alarm(wait_s);
  }
  ~Alarm() { alarm(0); }
  Alarm(const Alarm&) = delete;
  Alarm& operator=(const Alarm&) = delete;
};

}  // namespace

Launch::By built_with() {
#ifdef OPEN_MPI
  return Launch::By::open_mpi;
#else
  return Launch::By::mpich;
#endif
}

std::string mpi_version() {
#ifdef OPEN_MPI
  return "Open MPI " + std::to_string(OMPI_MAJOR_VERSION) + "." + std::to_string(OMPI_MINOR_VERSION) + "." +
         std::to_string(OMPI_RELEASE_VERSION);
#elif defined(MPICH_VERSION)
  return "MPICH " MPICH_VERSION;
#else
  return "an MPI like MPICH";
#endif
}

static int init(double deadline_s, int rank) {
  const Alarm alarm(deadline_s, rank);
  int got = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &got);
  MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
  catch_signals();  // MPI has set handlers of its own
  int size = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  return size;
}

MpiRanks::MpiRanks(int rank, double deadline_s)
    : Ranks(rank, init(deadline_s, rank)), deadline_s_(deadline_s) {}

void MpiRanks::exchange(int partner, std::span<const std::byte> mine, std::span<std::byte> theirs) {
  std::vector<MPI_Request> requests(2, MPI_REQUEST_NULL);
  longest_pause_ = std::max(longest_pause_, Clock::now() - last_);
  const int failed = MPI_Irecv(theirs.data(), static_cast<int>(theirs.size()), MPI_BYTE, partner, kDataTag,
                               MPI_COMM_WORLD, &requests[0]) |
                     MPI_Isend(mine.data(), static_cast<int>(mine.size()), MPI_BYTE, partner, kDataTag,
                               MPI_COMM_WORLD, &requests[1]);
  if (failed != MPI_SUCCESS) roll_call();
  try {
    wait(requests);
  } catch (...) {
    if (requests[0] != MPI_REQUEST_NULL) MPI_Cancel(&requests[0]);  // the buffer goes with the exception
    throw;
  }
  last_ = Clock::now();
}

void MpiRanks::wait(std::vector<MPI_Request>& requests) {
  const Clock::time_point begin = Clock::now();
  Clock::time_point limit = begin + seconds(deadline_s_), listened = begin;
  bool hurried = false;
  while (true) {
    int done = 0;
    const int result =
        MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
    if (done != 0) return;
    const Clock::time_point now = Clock::now();
    if (!hurried && interrupted()) {
      hurried = true;
      limit = std::min(limit, now + seconds(kHurriedS) + 2 * longest_pause_);
    }
    if (result != MPI_SUCCESS || now > limit) {
      roll_call();
      limit = Clock::now() + seconds(deadline_s_);
    }
    if (now - listened > std::chrono::milliseconds(2)) {
      listened = now;
      hear();
      if (!left_.empty()) throw RankLeft(left_.begin()->second);
      if (!here_.empty()) roll_call();
    }
    if (now - begin < std::chrono::milliseconds(1)) continue;  // MPI moves bytes only while it is asked
    if (now - begin < std::chrono::milliseconds(5)) {
      std::this_thread::yield();
    } else {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  }
}

void MpiRanks::tell_all(const std::string& news) {
  told_.push_back(news.substr(0, kMostText));
  for (int rank = 0; rank < size(); ++rank) {
    if (rank == this->rank()) continue;
    MPI_Isend(told_.back().data(), static_cast<int>(told_.back().size()), MPI_CHAR, rank, kNewsTag,
              MPI_COMM_WORLD, &telling_.emplace_back());
  }
}

void MpiRanks::hear() {
  while (true) {
    int there = 0, length = 0;
    MPI_Status status;
    if (MPI_Iprobe(MPI_ANY_SOURCE, kNewsTag, MPI_COMM_WORLD, &there, &status) != MPI_SUCCESS || there == 0)
      return;
    MPI_Get_count(&status, MPI_CHAR, &length);
    std::string news(static_cast<std::size_t>(length), ' ');
    MPI_Recv(news.data(), length, MPI_CHAR, status.MPI_SOURCE, kNewsTag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    (news.starts_with(kLeft) ? left_ : here_)[status.MPI_SOURCE] = news.substr(1);
  }
}

void MpiRanks::hear_for(double time, bool (MpiRanks::*enough)() const) {
  const Clock::time_point limit = Clock::now() + seconds(interrupted() ? kHurriedS : time);
  for (hear(); !(this->*enough)() && Clock::now() < limit; hear())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

bool MpiRanks::all_here() const { return static_cast<int>(here_.size()) == size() - 1 || !left_.empty(); }

bool MpiRanks::all_left() const { return static_cast<int>(left_.size()) == size() - 1; }

std::string MpiRanks::missing() const {
  std::string names;
  int count = 0;
  for (int rank = 0; rank < size(); ++rank) {
    if (rank == this->rank() || here_.contains(rank)) continue;
    names += (names.empty() ? "" : ", ") + std::to_string(rank);
    ++count;
  }
  return (count == 1 ? "rank " : "ranks ") + names + " of " + std::to_string(size()) +
         (count == 1 ? " has" : " have");
}

// Whoever waits in vain calls, and whoever hears it calls too: all that are left know the same of each other.
void MpiRanks::roll_call() {
  tell_all(std::string(1, kHere));
  hear_for(2, &MpiRanks::all_here);
  if (!left_.empty()) throw RankLeft(left_.begin()->second);
  if (static_cast<int>(here_.size()) == size() - 1) return here_.clear();  // slow, but alive
  throw RanksError(
      missing() + " not answered" +
      (interrupted() ? " after a signal" : " for " + format(deadline_s_) + " s") +
      ": killed, frozen, cut off or slow (--deadline); the last state is whole, continue from it with "
      "--resume");
}

bool MpiRanks::leave(const std::string& why) {
  tell_all(kLeft + why);
  hear_for(0.3, &MpiRanks::all_left);
  return left_.empty() || left_.begin()->first > rank();
}

void MpiRanks::finish(const EndWatch& watch) {
  gather("");
  watch.end_within(deadline_s_ + kAfterAlarmsS);
  const Alarm alarm(deadline_s_, rank());
  MPI_Finalize();
}

}  // namespace supertac
