// libFuzzer target: frame_decoder_fuzz corpus/frame_decoder -max_total_time=600 (the build unpacks the
// corpus)
#include "frame_decoder_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  supertac::check_frame_decoder(std::as_bytes(std::span(data, size)));
  return 0;
}
