#include "data/frames/binary_decoder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kMostReturns = 8;

/// A remainder of division by a polynomial.
struct Crc {
  std::string_view kind;
  unsigned bits;
  std::uint32_t polynomial, begin;
  bool reflected;  // polynomial too: lowest bit first
  std::uint32_t end;
  std::array<std::uint32_t, 256> table = {};

  constexpr Crc(std::string_view of, unsigned width, std::uint32_t by, std::uint32_t from, bool lowest,
                std::uint32_t crossed)
      : kind(of), bits(width), polynomial(by), begin(from), reflected(lowest), end(crossed) {
    const std::uint32_t top = std::uint32_t{1} << (bits - 1);
    for (std::uint32_t byte = 0; byte < 256; ++byte) {
      std::uint32_t sum = reflected ? byte : byte << (bits - 8);
      for (int bit = 0; bit < 8; ++bit)
        sum = reflected ? sum >> 1 ^ ((sum & 1) != 0 ? polynomial : 0)
                        : sum << 1 ^ ((sum & top) != 0 ? polynomial : 0);
      table[byte] = sum & (top | (top - 1));
    }
  }
  std::uint32_t of(std::span<const std::byte> bytes) const {
    std::uint32_t sum = begin;
    for (const std::byte byte : bytes) {
      const std::uint32_t at = (reflected ? sum : sum >> (bits - 8)) ^ std::to_integer<std::uint32_t>(byte);
      sum = table[at & 0xFF] ^ (bits == 8 ? 0 : reflected ? sum >> 8 : sum << 8);
      if (bits < 32) sum &= (1U << bits) - 1;
    }
    return sum ^ end;
  }
};
constexpr Crc kCrcs[] = {{"crc8", 8, 0x07, 0, false, 0},
                         {"crc16-modbus", 16, 0xA001, 0xFFFF, true, 0},
                         {"crc16-ccitt", 16, 0x1021, 0xFFFF, false, 0},
                         {"crc16-xmodem", 16, 0x1021, 0, false, 0},
                         {"crc32", 32, 0xEDB88320, 0xFFFFFFFF, true, 0xFFFFFFFF}};

std::span<const std::byte> bytes_in(const std::string& text) { return std::as_bytes(std::span(text)); }

}  // namespace

std::uint64_t bits_at(const std::byte* bytes, std::size_t count, bool big_endian) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i)
    bits = bits << 8 | std::to_integer<std::uint64_t>(bytes[big_endian ? i : count - 1 - i]);
  return bits;
}

std::size_t bytes_of(const std::string& type) {
  return static_cast<std::size_t>(std::stoi(type.substr(1))) / 8;  // "u16"
}

double number_at(const std::byte* bytes, const std::string& type, bool big_endian) {
  const std::uint64_t bits = bits_at(bytes, bytes_of(type), big_endian);
  if (type == "f32") return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  if (type == "f64") return std::bit_cast<double>(bits);
  if (type == "i8") return static_cast<double>(static_cast<std::int8_t>(bits));
  if (type == "i16") return static_cast<double>(static_cast<std::int16_t>(bits));
  if (type == "i32") return static_cast<double>(static_cast<std::int32_t>(bits));
  return static_cast<double>(bits);
}

std::size_t checksum_bytes(const std::string& kind) {
  return kind == "none" ? 0 : kind == "crc32" ? 4 : kind.find("16") != std::string::npos ? 2 : 1;
}

std::uint32_t checksum_of(const std::string& kind, std::span<const std::byte> bytes) {
  for (const Crc& crc : kCrcs)
    if (crc.kind == kind) return crc.of(bytes);
  std::uint32_t sum = 0;
  for (const std::byte b : bytes) {
    const auto byte = std::to_integer<std::uint32_t>(b);
    sum = kind == "xor8" ? sum ^ byte : sum + byte;
  }
  return sum & (kind == "sum16" ? 0xFFFF : 0xFF);
}

BinaryDecoder::BinaryDecoder(const FrameFormat& format, std::size_t values, bool certain)
    : format_(format),
      value_bytes_(bytes_of(format.type)),
      certain_(certain),
      vague_(format.checksum == "none" && format.trailer.empty()) {
  using Is = FrameField::Is;
  std::vector<FrameField> fields = format.fields;
  if (fields.empty() && format.time) fields.push_back({.is = Is::time});
  if (format.fields.empty()) fields.push_back({.is = Is::values, .count = values});
  std::size_t at = format.header.size();
  for (const FrameField& field : fields) {
    if (field.is == Is::values) runs_.emplace_back(at, field.count);
    if (field.is == Is::time) time_at_ = at;
    at += field.is == Is::values ? field.count * value_bytes_
          : field.is == Is::skip ? field.count
                                 : bytes_of(field.is == Is::time ? format.time->type : field.type);
  }
  checksum_at_ = at;
  size_ = at + checksum_bytes(format.checksum) + format.trailer.size();
}

bool BinaryDecoder::has_header(const std::byte* start, std::size_t left) const {
  const std::size_t count = std::min(left, format_.header.size());
  return std::equal(start, start + count, bytes_in(format_.header).begin());
}

bool BinaryDecoder::is_frame(const std::byte* start) const {
  const auto trailer = bytes_in(format_.trailer);
  if (!has_header(start, size()) ||
      !std::equal(trailer.begin(), trailer.end(), start + size() - trailer.size()))
    return false;
  if (format_.checksum == "none") return true;
  const std::size_t from = format_.checksum_from.value_or(format_.header.size());
  return bits_at(start + checksum_at_, checksum_bytes(format_.checksum),
                 format_.checksum_big_endian.value_or(format_.big_endian)) ==
         checksum_of(format_.checksum, {start + from, checksum_at_ - from});
}

// In the middle of nowhere a header and a trailer may stand a frame apart by chance, and go on doing so while
// the signals rest; then the frame behind must agree.
std::optional<bool> BinaryDecoder::accepts() const {
  const std::byte* start = buffer_.data() + position_;
  const std::size_t left = buffer_.size() - position_;
  if (!has_header(start, left)) return false;
  if (left < size()) return std::nullopt;
  if (!is_frame(start)) return false;
  if (vague_ || certain_ || (ever_ && discarded_ <= 2 * size())) return true;
  if (left < 2 * size()) return std::nullopt;
  return is_frame(start + size());
}

std::pair<std::size_t, bool> BinaryDecoder::returns(std::size_t place) const {
  for (std::size_t n = 0; n < kMostReturns; ++n, place += size()) {
    const std::size_t left = place < buffer_.size() ? buffer_.size() - place : 0;
    if (left > 0 && !has_header(buffer_.data() + place, left)) return {n, false};
    if (left < format_.header.size()) return {n, true};
  }
  return {kMostReturns, false};
}

// What cannot be told apart within kMostReturns frames is the place nearest to where a frame was expected.
bool BinaryDecoder::search() {
  const std::size_t window = std::min(expected_ + size(), buffer_.size() - position_);
  std::size_t best = 0, most = 0, first_open = window, open = 0;
  bool best_open = false;
  const auto away = [&](std::size_t place) {
    return place > expected_ ? place - expected_ : expected_ - place;
  };
  for (std::size_t place = 0; place < window; ++place) {
    const auto [count, goes_on] = returns(position_ + place);
    if (goes_on) first_open = std::min(first_open, place), open += count > 0 ? 1 : 0;
    if (count > most || (count == most && away(place) < away(best)))
      best = place, most = count, best_open = goes_on;
  }
  if (most > 1 && open == (best_open ? 1 : 0)) {
    discard(best);
    return found_ = true;
  }
  if (most > 1) return false;
  discard(first_open);
  return first_open == window && position_ < buffer_.size();
}

void BinaryDecoder::push(std::span<const std::byte> bytes, const Sink& sink) {
  // A vague frame is kept: it may turn out to have swallowed the beginning of the next.
  const std::size_t kept = vague_ && found_ && ever_ ? size() : 0;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(position_ - kept));
  position_ = kept;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  counters_.bytes += bytes.size();
  while (position_ < buffer_.size()) {
    if (vague_ && !found_) {
      if (!search()) return;
      continue;
    }
    const std::optional<bool> accepted = accepts();
    if (!accepted) return;
    if (*accepted) {
      hand_over(buffer_.data() + position_, sink);
      position_ += size();
      discarded_ = expected_ = 0;
      found_ = ever_ = true;
    } else if (vague_) {
      found_ = false;
      position_ -= size() - 1;
      expected_ = size() - 1;
      discarded_ = 1;
      ++counters_.torn;
    } else {
      discard(1);
    }
  }
}

void BinaryDecoder::discard(std::size_t count) {
  if (count == 0) return;
  found_ = false;
  counters_.torn += discarded_ == 0 ? 1 : 0;
  position_ += count;
  discarded_ += count;
  expected_ -= std::min(count, expected_);
  counters_.discarded_bytes += count;
}

void BinaryDecoder::hand_over(const std::byte* start, const Sink& sink) {
  values_.clear();
  for (const auto& [at, count] : runs_)
    for (std::size_t k = 0; k < count; ++k)
      values_.push_back(
          static_cast<float>(number_at(start + at + k * value_bytes_, format_.type, format_.big_endian)));
  DecodedFrame frame{values_, std::nullopt};
  if (format_.time)
    frame.time_s = number_at(start + time_at_, format_.time->type, format_.big_endian) * format_.time->unit_s;
  ++counters_.frames;
  sink(frame);
}

namespace {

constexpr std::byte kFrameHeader{0x24}, kFrameTrailer{0x21};

BoardFrame parse_frame(const std::byte* bytes) {
  const auto sample = [bytes](std::size_t at) {
    return static_cast<std::uint16_t>(bits_at(bytes + at, 2, true));
  };
  BoardFrame frame;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) frame.samples[n] = sample(1 + 2 * n);
  frame.slip = sample(161);
  return frame;
}

}  // namespace

void write_frame(const BoardFrame& frame, std::span<std::byte, rig::kFrameBytes> out) {
  const auto put = [&out](std::size_t at, std::uint16_t value) {
    if (value >= rig::kAdcCodes)
      throw std::invalid_argument(refusal(
          "write_frame", "sample", "0 to " + std::to_string(rig::kAdcCodes - 1), std::to_string(value)));
    out[at] = static_cast<std::byte>(value >> 8);
    out[at + 1] = static_cast<std::byte>(value & 0xFF);
  };
  out[0] = kFrameHeader;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) put(1 + 2 * n, frame.samples[n]);
  put(161, frame.slip);
  out[rig::kFrameBytes - 1] = kFrameTrailer;
}

BoardDecoder::BoardDecoder()
    : BinaryDecoder({.kind = FrameKind::binary,
                     .header = {std::to_integer<char>(kFrameHeader)},
                     .trailer = {std::to_integer<char>(kFrameTrailer)},
                     .fields = {{.is = FrameField::Is::skip, .count = rig::kFrameBytes - 2}}},
                    0, true) {}

bool BoardDecoder::is_frame(const std::byte* start) const {
  if (start[0] != kFrameHeader || start[rig::kFrameBytes - 1] != kFrameTrailer) return false;
  for (std::size_t at = 1; at < rig::kFrameBytes - 1; at += 2)  // the high bytes
    if ((start[at] & std::byte{0xF0}) != std::byte{0}) return false;
  return true;
}

bool BoardDecoder::jumps() {
  bool far = false;
  for (int k = 0; k < rig::kTaxels && !first_; ++k)
    far = far || std::abs(frame_.taxel(k) - before_[static_cast<std::size_t>(k)]) > 124;
  first_ = false;
  const bool jump = far && jumps_ < 3;
  jumps_ = jump ? jumps_ + 1 : 0;
  for (int k = 0; k < rig::kTaxels && !jump; ++k) before_[static_cast<std::size_t>(k)] = frame_.taxel(k);
  return jump;
}

void BoardDecoder::hand_over(const std::byte* start, const Sink& sink) {
  frame_ = parse_frame(start);
  std::array<float, rig::kTaxels> volts{};
  for (int k = 0; k < rig::kTaxels; ++k)
    volts[static_cast<std::size_t>(k)] =
        static_cast<float>(frame_.taxel(k)) * static_cast<float>(rig::kAdcVolts / rig::kAdcCodes);
  ++counters_.frames;
  sink({.values = volts,
        .time_s = std::nullopt,
        .damaged = static_cast<std::uint32_t>((discarded() + rig::kFrameBytes - 1 - 8) / rig::kFrameBytes),
        .suspect = discarded() > 0,
        .jump = jumps()});
}

}  // namespace supertac
