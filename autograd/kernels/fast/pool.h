// Reused memory for tensors and graph nodes.
//
// A training step asks for the same few hundred buffers each time. Released blocks wait in a free
// list of their size class and are handed out again, so that a warm step never calls the heap.
// The lists belong to the calling thread: a warm step takes no lock, and a block may be released by another
// thread. What a warm step touches lies together in large pages, where the system has them.
#pragma once

#include <cstddef>

namespace supertac {

/// Returns `bytes` rounded up to its size class, aligned to 64 bytes, contents undefined.
/// Throws std::bad_alloc.
void* pool_allocate(std::size_t bytes);

/// Gives a block back; `bytes` is the number that was asked for.
void pool_release(void* block, std::size_t bytes) noexcept;

/// For containers and handles whose memory is to come from the pool. Scratch memory of a function is a
/// Tensor.
template <class T>
struct PoolAllocator {
  using value_type = T;
  PoolAllocator() = default;
  template <class U>
  PoolAllocator(const PoolAllocator<U>&) {}
  T* allocate(std::size_t count) { return static_cast<T*>(pool_allocate(count * sizeof(T))); }
  void deallocate(T* block, std::size_t count) noexcept { pool_release(block, count * sizeof(T)); }
  bool operator==(const PoolAllocator&) const = default;
};

}  // namespace supertac
