#pragma once

#include <string>

namespace supertac {

/// Lines of --version for programs that compute: the kernels chosen on this processor.
std::string numerics_text();

}  // namespace supertac
