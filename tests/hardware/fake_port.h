// Ports of tests: those that say a text of their own, and one that changes what another says.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "hardware/ports/port.h"

namespace supertac {

inline std::string as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Has a clock that nothing but the test moves.
class FakePort : public Port {
 public:
  const std::string& name() const override { return name_; }
  double now() override { return now_; }
  double write(std::span<const std::byte>, double) override { return now_; }

 protected:
  /// As much of `said_` as the buffer has room for, now.
  Received hand_on(std::span<std::byte> buffer) {
    const std::size_t count = std::min(buffer.size(), said_.size());
    std::copy_n(std::as_bytes(std::span(said_)).begin(), count, buffer.begin());
    said_.erase(0, count);
    return {count, now_};
  }

  std::string name_ = "script", said_;
  double now_ = 0;
};

/// Stands between a driver and the port `inner_`; `now_` is when what it hands on arrived there.
class WrappedPort : public FakePort {
 public:
  explicit WrappedPort(std::unique_ptr<Port> inner) : inner_(std::move(inner)) { name_ = inner_->name(); }
  double now() override { return inner_->now(); }
  double write(std::span<const std::byte> bytes, double until) override {
    return inner_->write(bytes, until);
  }

 protected:
  std::unique_ptr<Port> inner_;
};

/// A device that answers every line by a rule of its own, in a time that passes while it is read.
class ScriptedPrinter : public FakePort {
 public:
  using Answer = std::function<std::string(const std::string& line)>;
  explicit ScriptedPrinter(Answer answer, std::string always = {})
      : answer_(std::move(answer)), always_(std::move(always)) {}
  Received read(std::span<std::byte> buffer, double until) override {
    now_ += always_.empty() && said_.empty() ? std::max(0.0, until - now_) : 0.01;
    said_ += always_;
    return hand_on(buffer);
  }
  double write(std::span<const std::byte> bytes, double) override {
    const std::string text = as_text(bytes);
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      if (end > at) said_ += answer_(text.substr(at, end - at));
      at = end + 1;
    }
    ++writes_;
    return now_;
  }
  int writes() const { return writes_; }

 private:
  Answer answer_;
  std::string always_;
  int writes_ = 0;
};

}  // namespace supertac
