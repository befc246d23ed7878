#include "autograd/kernels/fast/pool.h"

#include <sys/mman.h>

#include <array>
#include <bit>
#include <cstddef>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

namespace supertac {
namespace {

constexpr std::size_t kAlignment = 64;
constexpr std::size_t kSmallest = 64;
constexpr std::size_t kStepsPerDoubling = 4;

// Apart from the blocks, so that giving one out does not wait for its memory.
using FreeBlocks = std::array<std::vector<void*>, 1 + 40 * kStepsPerDoubling>;

struct SizeClass {
  std::size_t index;
  std::size_t bytes;
};

// Classes grow by 2^(1/4)-like steps (1, 1.25, 1.5, 1.75, 2 ...), so at most a fifth is wasted.
SizeClass class_of(std::size_t bytes) {
  if (bytes <= kSmallest) return {0, kSmallest};
  const std::size_t exponent = std::bit_width(bytes - 1) - 1;  // 2^exponent <= bytes - 1
  const std::size_t base = std::size_t{1} << exponent;
  const std::size_t step = base / kStepsPerDoubling;
  const std::size_t quarter = (bytes - 1 - base) / step;  // 0..3
  const std::size_t first_exponent = std::bit_width(kSmallest) - 1;
  return {1 + (exponent - first_exponent) * kStepsPerDoubling + quarter, base + (quarter + 1) * step};
}

void* take_last(std::vector<void*>& list) {
  void* block = list.back();
  list.pop_back();
  return block;
}

// Without memory for the list, of a thread that gets blocks from others, the block is lost.
void keep(void* block, std::vector<void*>& list) noexcept {
  try {
    list.push_back(block);
  } catch (const std::bad_alloc&) {
  }
}

// What all threads share: memory to cut blocks from, and the blocks of threads that have ended. It is asked
// while a program warms up, and lives as long as the program.
class Source {
 public:
  void* take(SizeClass size_class) {
    const std::lock_guard lock(mutex_);
    std::vector<void*>& list = left_.at(size_class.index);
    return list.empty() ? cut(size_class.bytes) : take_last(list);
  }

  void give_back(void* block, std::size_t index) noexcept {
    const std::lock_guard lock(mutex_);
    keep(block, left_[index]);
  }

 private:
  // Where pages are large, the blocks of a step together need few entries of the processor's TLB.
  static constexpr std::size_t kPage = std::size_t{2} << 20, kChunk = 4 * kPage;
  // Blocks of 2^n bytes one behind the other would share their places in the caches.
  static constexpr std::size_t kGap = 3 * kAlignment;

  void* cut(std::size_t bytes) {
#ifdef __SANITIZE_ADDRESS__  // which knows where a block ends if it comes from the heap
    return ::operator new(bytes, std::align_val_t(kAlignment));
#else
    const std::size_t whole = (bytes + kGap + kAlignment - 1) / kAlignment * kAlignment;
    if (whole > kChunk / 4) return new_chunk(whole);
    if (whole > rest_) {
      next_ = new_chunk(kChunk);
      rest_ = kChunk;
    }
    rest_ -= whole;
    return std::exchange(next_, next_ + whole);
#endif
  }

  static std::byte* new_chunk(std::size_t bytes) {
    const std::size_t whole = (bytes + kPage - 1) / kPage * kPage;
    void* chunk = ::operator new(whole, std::align_val_t(kPage));
#ifdef MADV_HUGEPAGE
    madvise(chunk, whole, MADV_HUGEPAGE);  // where the system refuses, small pages serve
#endif
    return static_cast<std::byte*>(chunk);
  }

  std::mutex mutex_;
  FreeBlocks left_;
  std::byte* next_ = nullptr;
  std::size_t rest_ = 0;
};

Source& source() {
  static auto& source = *new Source;
  return source;
}

class Pool {
 public:
  ~Pool() {
    closed_ = true;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      for (void* block : free_[i]) source().give_back(block, i);
    }
  }

  void* allocate(std::size_t bytes) {
    const SizeClass size_class = class_of(bytes);
    if (closed_) return source().take(size_class);
    std::vector<void*>& list = free_.at(size_class.index);
    if (list.empty()) {
      // Now, since a release cannot say that there is no memory for its list.
      const std::size_t made = ++made_[size_class.index];
      if (list.capacity() < made) list.reserve(2 * made);
      return source().take(size_class);
    }
    return take_last(list);
  }

  void release(void* block, std::size_t bytes) noexcept {
    const std::size_t index = class_of(bytes).index;
    closed_ ? source().give_back(block, index)  // a tensor with static lifetime outlives its thread's pool
            : keep(block, free_[index]);
  }

 private:
  FreeBlocks free_;
  std::array<std::size_t, std::tuple_size_v<FreeBlocks>> made_{};  // blocks that this thread asked for
  bool closed_ = false;
};

thread_local Pool pool;

}  // namespace

void* pool_allocate(std::size_t bytes) { return pool.allocate(bytes); }
void pool_release(void* block, std::size_t bytes) noexcept { pool.release(block, bytes); }

}  // namespace supertac
