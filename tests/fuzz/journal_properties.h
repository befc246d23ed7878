// What must hold for the journal's reader on any bytes.
#pragma once

#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "io/numbers/hash.h"

namespace supertac {

/// The bytes with the CRC-32 of every chunk put right, so that a fuzzer gets past them.
inline std::vector<std::byte> with_right_sums(std::span<const std::byte> input) {
  std::vector<std::byte> bytes(input.begin(), input.end());
  for (auto rest = std::span(bytes); rest.size() >= 24;) {
    std::uint32_t length = 0;
    std::memcpy(&length, rest.data() + 8, sizeof length);
    if (length > rest.size() - 24) break;
    const std::uint32_t head = crc32(rest.subspan(16, 8), crc32(rest.subspan(4, 8)));
    const std::uint32_t sum = crc32(rest.subspan(24, length), head);
    std::memcpy(rest.data() + 12, &sum, sizeof sum);
    rest = rest.subspan(24 + length);
  }
  return bytes;
}

inline void check_one_journal(std::span<const std::byte> input) {
  try {
    const Journal journal = parse_journal(input, "fuzz");
    if (journal.torn_bytes > input.size()) throw std::logic_error("journal: more torn bytes than bytes");
    const Collection collection = collection_of(journal);
    for (const CollectedPass& pass : collection.passes) {
      const std::size_t frames = pass.time_s.size();
      if (pass.signals.size() != collection.sensor.array.signals() * frames ||
          pass.position.size() != 3 * frames || pass.suspect.size() != frames) {
        throw std::logic_error("collection: a pass whose columns differ in length");
      }
    }
  } catch (const JournalError&) {
  }
}

/// Any bytes are a journal or a JournalError, and what is read can be turned into passes.
inline void check_journal(std::span<const std::byte> input) {
  check_one_journal(input);
  check_one_journal(with_right_sums(input));
}

}  // namespace supertac
