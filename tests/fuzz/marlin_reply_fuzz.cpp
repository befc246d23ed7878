// libFuzzer target: any text is a reply of some kind.
#include "hardware/marlin_line.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  (void)supertac::parse_reply({reinterpret_cast<const char*>(data), size});
  return 0;
}
