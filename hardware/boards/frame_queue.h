// What a live reader hands over: frames from the thread that reads them to whoever asks, and what ended it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace supertac {

/// The half of a reader that all readers share. A reader starts thread_ when it is whole, and its destructor
/// calls stop().
template <class Frame>
class FrameQueue {
 public:
  FrameQueue(const FrameQueue&) = delete;
  FrameQueue& operator=(const FrameQueue&) = delete;

  /// Ends the thread; what it has read already can still be taken.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    taken_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  /// The next frame, oldest first; empty after `wait_s` of wall time, or at the end. Rethrows what ended the
  /// reader once the frames before it have been taken.
  std::optional<Frame> next(double wait_s) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, std::chrono::duration<double>(wait_s), [&] { return !queue_.empty() || ended_; });
    if (!queue_.empty()) {
      Frame frame = std::move(queue_.front());
      queue_.pop_front();
      taken_.notify_one();
      return frame;
    }
    if (error_) std::rethrow_exception(error_);
    return std::nullopt;
  }

  /// Rethrows what ended the reader, without waiting and without taking frames.
  void check() {
    const std::lock_guard lock(mutex_);
    if (error_) std::rethrow_exception(error_);
  }

  /// Waits at most `wait_s` of wall time for the reader to end by itself.
  void wait_for_end(double wait_s) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, std::chrono::duration<double>(wait_s), [&] { return ended_; });
  }

  /// The source is at its end and all frames have been taken.
  bool ended() const {
    const std::lock_guard lock(mutex_);
    return ended_ && queue_.empty() && !error_;
  }

 protected:
  /// A queue of `most` frames that is full drops the oldest, or holds the thread up where it `waits`.
  FrameQueue(std::size_t most, bool waits) : most_(most), waits_(waits) {}
  ~FrameQueue() = default;

  // For the reader's thread. `lock` holds mutex_; whoever calls end() holds it, too.
  bool asked_to_stop() {
    const std::lock_guard lock(mutex_);
    return stop_;
  }
  void put(std::unique_lock<std::mutex>& lock, Frame frame) {
    if (waits_) {
      taken_.wait(lock, [&] { return queue_.size() < most_ || stop_; });
    } else if (queue_.size() >= most_) {
      queue_.pop_front();
      ++dropped_;
    }
    queue_.push_back(std::move(frame));
    arrived_.notify_one();
  }
  void end() {
    ended_ = true;
    arrived_.notify_all();
  }

  mutable std::mutex mutex_;
  std::exception_ptr error_;
  std::uint64_t dropped_ = 0;
  std::thread thread_;

 private:
  std::condition_variable arrived_, taken_;
  std::deque<Frame> queue_;
  std::size_t most_;
  bool waits_, stop_ = false, ended_ = false;
};

}  // namespace supertac
