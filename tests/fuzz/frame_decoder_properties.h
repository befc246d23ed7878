// What must hold for the frame decoder on any bytes.
#pragma once

#include <algorithm>
#include <span>
#include <stdexcept>
#include <vector>

#include "data/frames/board_frame.h"

namespace supertac {

/// The first byte chooses the size of the pieces, the rest is the stream. Every byte is in a frame,
/// discarded, or still pending; pieces change nothing; every frame's samples have 12 bits. Throws
/// std::logic_error otherwise.
inline void check_frame_decoder(std::span<const std::byte> input) {
  if (input.empty()) return;
  const std::size_t piece = 1 + std::to_integer<std::size_t>(input[0]);
  const auto stream = input.subspan(1);
  BoardDecoder whole, pieces;
  std::vector<BoardFrame> expected, found;
  whole.push(stream, [&](const DecodedFrame&) { expected.push_back(whole.frame()); });
  for (std::size_t at = 0; at < stream.size(); at += piece) {
    pieces.push(stream.subspan(at, std::min(piece, stream.size() - at)),
                [&](const DecodedFrame&) { found.push_back(pieces.frame()); });
  }
  if (expected != found) throw std::logic_error("frame decoder: pieces give other frames than the whole");
  for (const BoardDecoder* decoder : {&whole, &pieces}) {
    const BoardDecoder::Counters& counters = decoder->counters();
    if (counters.frames * rig::kFrameBytes + counters.discarded_bytes + decoder->pending() !=
            counters.bytes ||
        counters.bytes != stream.size() || decoder->pending() >= rig::kFrameBytes) {
      throw std::logic_error("frame decoder: bytes are not accounted for");
    }
  }
  for (const BoardFrame& frame : found) {
    for (const std::uint16_t sample : frame.samples) {
      if (sample >= rig::kAdcCodes) throw std::logic_error("frame decoder: a sample has more than 12 bits");
    }
  }
}

}  // namespace supertac
