#pragma once

#include <string>

namespace supertac {

/// Says that nobody knows where a printer's head is: set while a run moves it, and left by one that did not
/// end with the head back at its origin, were it by kill -9 or a power cut. It belongs to the printer, not to
/// a folder of recordings: a file $XDG_STATE_HOME/supertac/origin-unknown/PORT (~/.local/state/...).
class OriginMark {
 public:
  /// Throws FileError when there is no place for it.
  explicit OriginMark(const std::string& printer_port);
  bool is_set() const;
  /// `why`: how the run ended. On the disk when it returns. Throws FileError
  void set(const std::string& why = "was cut off") const;
  /// That of the run that left it.
  std::string why() const;
  /// Throws FileError
  void clear() const;

 private:
  std::string file_;
};

}  // namespace supertac
