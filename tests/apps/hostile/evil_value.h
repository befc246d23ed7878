// Values of options, or of a file's entries, by somebody who means no good.
#pragma once

#include <cstdint>
#include <string>

#include "io/numbers/random.h"

namespace supertac {

std::string evil_value(const RandomStream& random, std::uint64_t at);

}  // namespace supertac
