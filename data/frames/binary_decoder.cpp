#include "data/frames/binary_decoder.h"

#include <algorithm>
#include <bit>

namespace supertac {
namespace {

std::uint64_t bits_at(const std::byte* bytes, std::size_t count, bool big_endian) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i)
    bits = bits << 8 | std::to_integer<std::uint64_t>(bytes[big_endian ? i : count - 1 - i]);
  return bits;
}

std::span<const std::byte> bytes_in(const std::string& text) { return std::as_bytes(std::span(text)); }

}  // namespace

std::size_t bytes_of(const std::string& type) {
  return static_cast<std::size_t>(std::stoi(type.substr(1))) / 8;  // "u16"
}

double number_at(const std::byte* bytes, const std::string& type, bool big_endian) {
  const std::uint64_t bits = bits_at(bytes, bytes_of(type), big_endian);
  if (type == "f32") return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  if (type == "f64") return std::bit_cast<double>(bits);
  if (type == "i8") return static_cast<double>(static_cast<std::int8_t>(bits));
  if (type == "i16") return static_cast<double>(static_cast<std::int16_t>(bits));
  return static_cast<double>(bits);
}

std::size_t checksum_bytes(const std::string& kind) {
  return kind == "none" ? 0 : kind.starts_with("crc16") ? 2 : 1;
}

std::uint32_t checksum_of(const std::string& kind, std::span<const std::byte> bytes) {
  std::uint32_t sum = kind.starts_with("crc16") ? 0xFFFF : 0;
  for (const std::byte b : bytes) {
    const auto byte = std::to_integer<std::uint32_t>(b);
    if (kind == "sum8") sum = (sum + byte) & 0xFF;
    if (kind == "xor8") sum ^= byte;
    if (kind == "crc16-modbus") {  // polynomial 0x8005, reflected
      sum ^= byte;
      for (int bit = 0; bit < 8; ++bit) sum = (sum & 1) != 0 ? sum >> 1 ^ 0xA001 : sum >> 1;
    }
    if (kind == "crc16-ccitt") {  // polynomial 0x1021, also called CCITT-FALSE
      sum ^= byte << 8;
      for (int bit = 0; bit < 8; ++bit) sum = ((sum & 0x8000) != 0 ? sum << 1 ^ 0x1021 : sum << 1) & 0xFFFF;
    }
  }
  return sum;
}

BinaryDecoder::BinaryDecoder(const Sensor& sensor)
    : format_(sensor.frame), count_(sensor.values()), value_bytes_(bytes_of(sensor.frame.type)) {
  values_at_ = format_.header.size() + (format_.time ? bytes_of(format_.time->type) : 0);
  size_ = values_at_ + count_ * value_bytes_ + checksum_bytes(format_.checksum) + format_.trailer.size();
  vague_ = format_.checksum == "none" && format_.trailer.empty();
}

bool BinaryDecoder::has_header(const std::byte* start, std::size_t left) const {
  const std::size_t count = std::min(left, format_.header.size());
  return std::equal(start, start + count, bytes_in(format_.header).begin());
}

bool BinaryDecoder::is_frame(const std::byte* start) const {
  const auto trailer = bytes_in(format_.trailer);
  if (!has_header(start, size_) ||
      !std::equal(trailer.begin(), trailer.end(), start + size_ - trailer.size()))
    return false;
  if (format_.checksum == "none") return true;
  const std::size_t from = format_.header.size(), sum_bytes = checksum_bytes(format_.checksum);
  const std::size_t end = size_ - trailer.size() - sum_bytes;
  return bits_at(start + end, sum_bytes, format_.big_endian) ==
         checksum_of(format_.checksum, {start + from, end - from});
}

// In the middle of nowhere a header and a trailer may stand a frame apart by chance, and go on doing so while
// the signals rest; then the frame behind must agree.
std::optional<bool> BinaryDecoder::accepts() const {
  const std::byte* start = buffer_.data() + position_;
  const std::size_t left = buffer_.size() - position_;
  if (!has_header(start, left)) return false;
  if (left < size_) return std::nullopt;
  if (!is_frame(start)) return false;
  if (ever_ && discarded_ <= 2 * size_) return true;
  if (left < 2 * size_) return std::nullopt;
  return is_frame(start + size_);
}

void BinaryDecoder::push(std::span<const std::byte> bytes, const Sink& sink) {
  // A vague frame is kept: it may turn out to have swallowed the beginning of the next.
  const std::size_t kept = vague_ && found_ ? size_ : 0;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(position_ - kept));
  position_ = kept;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  counters_.bytes += bytes.size();
  while (position_ < buffer_.size()) {
    const std::optional<bool> accepted = accepts();
    if (!accepted) return;
    if (*accepted) {
      hand_over(buffer_.data() + position_, sink);
      position_ += size_;
      discarded_ = 0;
      found_ = ever_ = true;
    } else if (vague_ && found_) {
      found_ = false;
      position_ -= size_ - 1;
      discarded_ = 1;
      ++counters_.torn;
    } else {
      discard(1);
    }
  }
}

void BinaryDecoder::discard(std::size_t count) {
  found_ = false;
  counters_.torn += discarded_ == 0 ? 1 : 0;
  position_ += count;
  discarded_ += count;
  counters_.discarded_bytes += count;
}

void BinaryDecoder::hand_over(const std::byte* start, const Sink& sink) {
  values_.clear();
  for (std::size_t k = 0; k < count_; ++k)
    values_.push_back(static_cast<float>(
        number_at(start + values_at_ + k * value_bytes_, format_.type, format_.big_endian)));
  DecodedFrame frame{values_, std::nullopt};
  if (format_.time)
    frame.time_s = number_at(start + format_.header.size(), format_.time->type, format_.big_endian) *
                   format_.time->unit_s;
  ++counters_.frames;
  sink(frame);
}

}  // namespace supertac
