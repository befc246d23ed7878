// What a picture costs a live stream beside arithmetic: no block of the heap, no lock, no thread that runs or
// spins.
#include <dlfcn.h>
#include <pthread.h>

#include "apps/stream/picture_maker.h"
#include "data/sensors/rig.h"
#include "tests/allocations.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace {
std::atomic<long> locks{0};
}

// In front of the C library's: every std::mutex and every lock of OpenMP's runtime or of stdio comes through
// here.
extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static const auto real =
      reinterpret_cast<int (*)(pthread_mutex_t*)>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  ++locks;
  return real(mutex);
}

namespace supertac {
namespace {

/// The rig's board, as far as a picture depends on it.
struct Board : SensorSource {
  Board() : SensorSource(rig::kFramePeriodS, 0, true) {}
  std::optional<SensorFrame> next(double) override { return std::nullopt; }
  bool ended() const override { return false; }
  ReaderCounters counters() override { return {}; }
  void finish() override {}
};

long threads() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return std::distance(begin(tasks), end(tasks));
}

class LivePath : public testing::TestWithParam<std::tuple<const char*, Precision>> {};

TEST_P(LivePath, APictureTakesNoHeapNoLockAndNoThread) {
  const auto [preset, precision] = GetParam();
  std::vector<ModelFile> models;
  models.push_back(model_of(SuperTacSettings::of_preset(preset), {.scaling = {}, .filter_s = rig::kFilterS}));
  const Board board;
  PictureMaker maker(models, board, precision);
  std::vector<float> volts(static_cast<std::size_t>(board.array().signals()));
  long pictures = 0, heap = 0, locked = 0;
  const auto frame = [&](int i) {
    for (std::size_t s = 0; s < volts.size(); ++s)
      volts[s] = static_cast<float>(rig::kRestVolts - 0.01 * ((static_cast<std::size_t>(i) + 7 * s) % 20));
    maker.push({i * rig::kFramePeriodS, volts});
    return !maker.picture().empty();
  };
  int i = 0;
  while (!frame(i)) ++i;
  for (int warm = 0; warm < 1100; ++warm) frame(++i);  // until every buffer has seen its fill
  const long before = threads();
  for (int n = 0; n < 200; ++n) {
    const long made = allocations::made, taken = locks;
    pictures += frame(++i);
    heap += allocations::made - made, locked += locks - taken;
  }
  EXPECT_EQ(pictures, 200);
  EXPECT_EQ(heap, 0);
  EXPECT_EQ(locked, 0);
  EXPECT_EQ(threads(), before);
  EXPECT_EQ(before, 1) << "a picture of one stream needs no second thread";
}

INSTANTIATE_TEST_SUITE_P(Models, LivePath,
                         testing::Combine(testing::Values("tiny", "paper"),
                                          testing::Values(Precision::fp32, Precision::int8)));

// The counters count.
TEST(LivePathCounters, ALockIsCounted) {
  const long before = locks;
  pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  pthread_mutex_lock(&mutex);
  pthread_mutex_unlock(&mutex);
  EXPECT_EQ(locks - before, 1);
}

}  // namespace
}  // namespace supertac
