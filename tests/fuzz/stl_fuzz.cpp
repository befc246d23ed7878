// libFuzzer target: stl_fuzz corpus/stl -max_total_time=600 (the build unpacks the corpus)
#include "stl_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  supertac::check_stl(std::as_bytes(std::span(data, size)));
  return 0;
}
