// libFuzzer target: any bytes are a journal, or a JournalError, and what is read can be turned into passes.
#include "hardware/collection.h"
#include "hardware/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  try {
    const supertac::Journal journal = supertac::parse_journal(std::as_bytes(std::span(data, size)), "fuzz");
    (void)supertac::collection_of(journal);
  } catch (const supertac::JournalError&) {
  }
  return 0;
}
