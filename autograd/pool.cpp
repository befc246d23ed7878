#include "autograd/pool.h"

#include <array>
#include <bit>
#include <new>
#include <vector>

namespace supertac {
namespace {

constexpr std::align_val_t kAlignment{64};
constexpr std::size_t kSmallest = 64;
constexpr std::size_t kStepsPerDoubling = 4;

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

class Pool {
 public:
  ~Pool() {
    closed_ = true;
    for (const std::vector<void*>& list : free_) {
      for (void* block : list) ::operator delete(block, kAlignment);
    }
  }

  void* allocate(std::size_t bytes) {
    const SizeClass size_class = class_of(bytes);
    std::vector<void*>& list = free_.at(size_class.index);
    if (closed_ || list.empty()) {
      ++heap_allocations_;
      return ::operator new(size_class.bytes, kAlignment);
    }
    void* block = list.back();
    list.pop_back();
    return block;
  }

  void release(void* block, std::size_t bytes) noexcept {
    if (closed_) {  // a tensor with static lifetime outlives its thread's pool
      ::operator delete(block, kAlignment);
      return;
    }
    try {
      free_[class_of(bytes).index].push_back(block);
    } catch (const std::bad_alloc&) {
      ::operator delete(block, kAlignment);
    }
  }

  std::uint64_t heap_allocations() const { return heap_allocations_; }

 private:
  // Apart from the blocks, so that giving one out does not wait for its memory.
  std::array<std::vector<void*>, 1 + 40 * kStepsPerDoubling> free_{};
  std::uint64_t heap_allocations_ = 0;
  bool closed_ = false;
};

thread_local Pool pool;

}  // namespace

void* pool_allocate(std::size_t bytes) { return pool.allocate(bytes); }
void pool_release(void* block, std::size_t bytes) noexcept { pool.release(block, bytes); }
std::uint64_t pool_heap_allocations() { return pool.heap_allocations(); }

}  // namespace supertac
