// libFuzzer target: journal_fuzz corpus/journal -max_total_time=600 (the build unpacks the corpus)
#include "journal_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  supertac::check_journal(std::as_bytes(std::span(data, size)));
  return 0;
}
