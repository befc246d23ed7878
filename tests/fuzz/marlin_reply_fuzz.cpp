// libFuzzer target: marlin_reply_fuzz corpus/marlin_reply -max_total_time=600 (the build unpacks the corpus)
#include "marlin_reply_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  supertac::check_marlin_replies(std::as_bytes(std::span(data, size)));
  return 0;
}
