// Ports of tests: one that says a text of its own, and one that changes what another says.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "hardware/ports/port.h"

namespace supertac {

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

inline std::string as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace supertac
