#include "data/frames/frame_decoder.h"

#include <cstring>

namespace supertac {

void FrameDecoder::append(std::span<const std::byte> bytes) {
  // What is left of the last push is less than a frame, so moving it to the front is cheap.
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(position_));
  position_ = 0;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  counters_.bytes += bytes.size();
}

const std::byte* FrameDecoder::next() {
  for (;;) {
    const std::size_t left = buffer_.size() - position_;
    const std::byte* start = buffer_.data() + position_;
    if (left > 0 && *start != kFrameHeader) {
      const void* header = std::memchr(start, std::to_integer<int>(kFrameHeader), left);
      discard(header == nullptr ? left
                                : static_cast<std::size_t>(static_cast<const std::byte*>(header) - start));
      continue;
    }
    if (left < rig::kFrameBytes) return nullptr;
    if (is_frame(start)) {
      position_ += rig::kFrameBytes;
      ++counters_.frames;
      return start;
    }
    discard(1);
  }
}

void FrameDecoder::discard(std::size_t count) {
  position_ += count;
  discarded_since_frame_ += count;
  counters_.discarded_bytes += count;
}

}  // namespace supertac
