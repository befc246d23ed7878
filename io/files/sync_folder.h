#pragma once

#include <cerrno>
#include <string>

namespace supertac {

/// fsync of the folder that holds `path`, so that a power cut does not lose a new name. False with errno set.
bool sync_folder_of(const std::string& path);

/// Calls again as long as a signal interrupts.
auto retry(const auto& call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

}  // namespace supertac
