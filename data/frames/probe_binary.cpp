// The period of a binary stream, and what stands where in it.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "data/frames/binary_decoder.h"
#include "data/frames/probe.h"

namespace supertac {
namespace {

constexpr std::size_t kLongestPeriod = 20'000, kLeastPeriod = 4, kFewPeriods = 4, kLongestHeader = 4;
constexpr double kAgree = 0.8;                        // some may have been torn
constexpr std::size_t kMostCompared = 4'000'000'000;  // bytes, some seconds: megabytes that hardly change

std::span<const std::byte> bytes_in(const std::string& text, std::size_t at, std::size_t count) {
  return std::as_bytes(std::span(text)).subspan(at, count);
}

std::size_t occurrences(const std::string& bytes, const std::string& pattern) {
  std::size_t count = 0;
  for (std::size_t at = bytes.find(pattern); at != std::string::npos; at = bytes.find(pattern, at + 1))
    ++count;
  return count;
}

struct Period {
  std::size_t length = 0, at = 0, constant = 0;  // where in the bytes the longest constant run begins
};

// The longest run of bytes that stay the same from period to period and stand nowhere else; nothing when
// there is none. A resting signal's high bytes stay the same, too, and so does a dead taxel: what is 0, or
// stands elsewhere in the frame as well, is no part of a header.
std::optional<Period> constant_run(const std::string& bytes, std::size_t from, std::size_t period,
                                   std::size_t& compared) {
  // All periods in a third of the bytes: whole values repeat themselves, too, but not over a header.
  const std::size_t count = bytes.size() / 3 / period;
  const auto at = [&](std::size_t phase) { return bytes[from + phase % period]; };
  const auto constant = [&](std::size_t phase) {
    for (std::size_t k = 1; k < count; ++k, ++compared)
      if (bytes[from + phase % period + k * period] != at(phase)) return false;
    return true;
  };
  std::array<std::size_t, 256> total{};
  const auto count_of = [&total](char c) -> std::size_t& { return total[static_cast<unsigned char>(c)]; };
  std::vector<bool> stays(period);
  for (std::size_t phase = 0; phase < period; ++phase) {
    stays[phase] = constant(phase);
    if (stays[phase]) ++count_of(at(phase));
  }
  Period best{period};
  std::size_t run = 0;
  for (std::size_t i = 0; i <= 2 * period && run < period; ++i) {
    if (stays[i % period]) {
      ++run;
      continue;
    }
    // The run before i has ended: what is left of it without common bytes at its ends.
    std::size_t first = i - run, length = run;
    for (std::size_t k = 0; k < run; ++k) --count_of(at(first + k));
    const auto common = [&](std::size_t phase) { return at(phase) == 0 || count_of(at(phase)) > 0; };
    while (length > 0 && common(first)) ++first, --length;
    while (length > 0 && common(first + length - 1)) --length;
    for (std::size_t k = 0; k < run; ++k) ++count_of(at(i - run + k));
    if (length > best.constant) best.constant = length, best.at = from + first % period;
    run = 0;
  }
  if (run >= period) return std::nullopt;  // nothing changes
  if (best.constant == 0 || best.constant == period) return std::nullopt;
  const std::string pattern = bytes.substr(best.at, std::min(best.constant, 2 * kLongestHeader));
  const double expected = static_cast<double>(bytes.size()) / static_cast<double>(period);
  const auto found = static_cast<double>(occurrences(bytes, pattern));
  if (found < 0.8 * expected - 1 || found > 1.1 * expected + 1) return std::nullopt;
  return best;
}

std::optional<Period> period_of(const std::string& bytes) {
  const std::size_t longest = std::min(kLongestPeriod, bytes.size() / 3 / kFewPeriods);
  std::size_t compared = 0;
  for (std::size_t period = kLeastPeriod; period <= longest && compared < kMostCompared; ++period)
    for (const std::size_t third : {1, 2, 0})  // bytes may have been lost in one of them
      if (const auto found = constant_run(bytes, third * (bytes.size() / 3), period, compared)) return found;
  return std::nullopt;
}

// Little or big endian by which byte of each pair moves less, where nothing has proven it; single bytes where
// both move alike.
void guess_type(const std::string& bytes, const Period& period, std::size_t values_at, std::size_t count,
                std::optional<bool> big_endian, FrameFormat& f) {
  std::array<double, 2> moved{};
  bool negative = true, positive = false, all = true;
  std::size_t real = 0, reals = 0;
  const std::size_t frames = (bytes.size() - period.at) / period.length;
  for (std::size_t n = 1; n < frames; ++n) {
    const std::size_t at = period.at + n * period.length + values_at;
    if (at + count > bytes.size()) break;
    for (std::size_t i = 0; i < count; ++i) {
      const int step = static_cast<signed char>(bytes[at + i] - bytes[at + i - period.length]);
      moved[i % 2] += std::abs(step);
    }
    for (std::size_t i = 0; i + 4 <= count; i += 4, ++reals) {
      const double value = number_at(bytes_in(bytes, at + i, 4).data(), "f32", big_endian.value_or(false));
      real += value == 0 || (std::abs(value) > 1e-6 && std::abs(value) < 1e7) ? 1 : 0;
    }
  }
  f.type = "u8";
  if (count % 4 == 0 && reals > 0 && static_cast<double>(real) > kAgree * static_cast<double>(reals)) {
    f.type = "f32", f.big_endian = big_endian.value_or(false);
    return;
  }
  if (count % 2 != 0 || std::max(moved[0], moved[1]) < 3 * std::min(moved[0], moved[1])) return;
  f.type = "u16", f.big_endian = big_endian.value_or(moved[0] < moved[1]);
  negative = false;
  for (std::size_t i = f.big_endian ? 0 : 1; i < count; i += 2) {
    const char high = bytes[period.at + period.length + values_at + i];
    negative = negative || high == static_cast<char>(0xFF), positive = positive || high == 0;
    all = all && (high == static_cast<char>(0xFF) || high == 0);
  }
  if (negative && (positive || all)) f.type = "i16";
}

}  // namespace

std::optional<BinaryFinding> find_binary_format(const std::string& bytes, double seconds,
                                                std::optional<std::size_t> values) {
  const auto period = period_of(bytes);
  if (!period) return std::nullopt;
  // From where the period was found: a terminal may have changed what came before it was opened.
  const std::size_t frames = (bytes.size() - period->at) / period->length;
  seconds *= static_cast<double>(frames * period->length) / static_cast<double>(bytes.size());
  const auto agrees = [&](std::size_t header, const std::string& kind, bool big) {
    const std::size_t width = checksum_bytes(kind);
    if (period->length <= header + width) return false;
    std::size_t right = 0;
    for (std::size_t n = 0; n < frames; ++n) {
      const std::size_t at = period->at + n * period->length, end = at + period->length - width;
      const double sent = number_at(bytes_in(bytes, end, width).data(), width == 1 ? "u8" : "u16", big);
      right += sent == checksum_of(kind, bytes_in(bytes, at + header, end - at - header)) ? 1 : 0;
    }
    return static_cast<double>(right) >= kAgree * static_cast<double>(frames) - 1 && right > 2;
  };
  BinaryFinding finding;
  FrameFormat& f = finding.format;
  f.kind = FrameKind::binary;
  // A checksum that is right says where the header ends; else it is what stays the same.
  std::size_t header = std::min(period->constant, kLongestHeader);
  for (std::size_t h = 1; h <= std::min(period->constant, 2 * kLongestHeader) && f.checksum == "none"; ++h)
    for (const char* kind : {"crc16-modbus", "crc16-ccitt", "sum8", "xor8"})
      for (const bool big : {false, true})
        if (f.checksum == "none" && agrees(h, kind, big)) header = h, f.checksum = kind, f.big_endian = big;
  const std::size_t behind = checksum_bytes(f.checksum);
  std::optional<bool> proven;  // by a checksum of two bytes, or a clock
  if (behind == 2) proven = f.big_endian;
  if (values && f.checksum == "none")
    for (std::size_t h = header; h >= 1; --h)
      if ((period->length - h) % *values == 0) header = h, h = 1;
  std::size_t values_at = header;
  for (const bool big : {false, true}) {
    if (period->length < header + 4 + behind || f.time || big != proven.value_or(big)) continue;
    std::vector<double> stamps;
    for (std::size_t n = 0; n < frames; ++n)
      stamps.push_back(
          number_at(bytes_in(bytes, period->at + n * period->length + header, 4).data(), "u32", big));
    if (const auto unit = unit_of_clock(stamps, seconds); unit && *unit < 1)
      f.time = FrameTime{.type = "u32", .unit_s = *unit}, f.big_endian = big, proven = big, values_at += 4;
  }
  f.header = bytes.substr(period->at, header);
  const std::size_t count = period->length - values_at - behind;
  guess_type(bytes, *period, values_at, count, proven, f);
  if (values && *values > 0 && count % *values == 0) {
    const std::size_t width = count / *values;
    if (width != bytes_of(f.type)) f.type = width == 1 ? "u8" : width == 2 ? "u16" : "u32";
    if (width != 1 && width != 2 && width != 4) return std::nullopt;
  }
  finding.values = count / bytes_of(f.type);
  if (finding.values * bytes_of(f.type) != count) return std::nullopt;
  return finding;
}

}  // namespace supertac
