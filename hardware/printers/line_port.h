#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "hardware/ports/port.h"

namespace supertac {

/// A port as lines of text, each with the time at which it came.
class LinePort {
 public:
  /// `port` must outlive it.
  explicit LinePort(Port& port) : port_(port) {}
  /// Called at least every 0.02 s while read() waits; what it throws ends the wait.
  void set_watch(std::function<void()> watch) { watch_ = std::move(watch); }

  /// Returns the port's time (s) before the write. Throws as Port::write().
  double send(const std::string& text);
  /// The next line that is not empty, without its break and trailing blanks; false when `until` passes first.
  /// Throws as Port::read().
  bool read(double until, std::string& line);
  /// The same of what has been received already.
  bool take(std::string& line);
  /// What has come of a line whose break has not.
  void forget() { input_.erase(input_.find_last_of("\r\n") + 1); }

  double arrival_s() const { return arrival_s_; }   ///< of the last byte received
  std::size_t bytes() const { return bytes_; }      ///< received so far
  std::size_t no_text() const { return no_text_; }  ///< of these, what no text has
  Port& port() { return port_; }
  const std::string& name() const { return port_.name(); }

 private:
  Port& port_;
  std::function<void()> watch_;
  std::string input_;  // received, not yet a whole line
  double arrival_s_ = 0;
  std::size_t bytes_ = 0, no_text_ = 0;
};

}  // namespace supertac
