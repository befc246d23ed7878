// Ranks that are threads of the test.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "models/training/ranks.h"

namespace supertac {

/// What the threads of one run share.
class Post {
 public:
  void send(int from, int to, std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    boxes_[{from, to}].emplace_back(bytes.begin(), bytes.end());
    arrived_.notify_all();
  }
  std::vector<std::byte> receive(int from, int to) {
    std::unique_lock lock(mutex_);
    auto& box = boxes_[{from, to}];
    if (!arrived_.wait_for(lock, std::chrono::seconds(60),
                           [&] { return !box.empty() || gone_.contains(from); }) ||
        box.empty())
      throw RanksError("rank " + std::to_string(from) + " has gone");
    std::vector<std::byte> bytes = std::move(box.front());
    box.pop_front();
    return bytes;
  }
  void leave(int rank) {
    const std::lock_guard lock(mutex_);
    gone_.insert(rank);
    arrived_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::map<std::pair<int, int>, std::deque<std::vector<std::byte>>> boxes_;
  std::set<int> gone_;
};

class ThreadRanks : public Ranks {
 public:
  ThreadRanks(int rank, int size, Post& post) : Ranks(rank, size), post_(post) {}
  void exchange(int partner, std::span<const std::byte> mine, std::span<std::byte> theirs) override {
    post_.send(rank(), partner, mine);
    const std::vector<std::byte> bytes = post_.receive(partner, rank());
    if (bytes.size() != theirs.size()) throw RanksError("another size than expected");
    std::copy(bytes.begin(), bytes.end(), theirs.begin());
  }

 private:
  Post& post_;
};

/// Runs `work` on every rank at once; returns what each threw ("" = nothing).
inline std::vector<std::string> on_ranks(int size, const std::function<void(Ranks&)>& work) {
  Post post;
  std::vector<std::string> errors(static_cast<std::size_t>(size));
  std::vector<std::thread> threads;
  for (int rank = 0; rank < size; ++rank) {
    threads.emplace_back([&, rank] {
      try {
        ThreadRanks ranks(rank, size, post);
        work(ranks);
      } catch (const std::exception& error) {
        errors[static_cast<std::size_t>(rank)] = error.what();
        post.leave(rank);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  return errors;
}

}  // namespace supertac
