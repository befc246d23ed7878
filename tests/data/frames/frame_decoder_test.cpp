#include "data/frames/binary_decoder.h"

#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::frame_decoder_test {

std::vector<BoardFrame> decode_board(BoardDecoder& decoder, std::span<const std::byte> bytes,
                                     std::size_t piece) {
  std::vector<BoardFrame> frames;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    decoder.push(bytes.subspan(at, std::min(piece, bytes.size() - at)),
                 [&](const DecodedFrame&) { frames.push_back(decoder.frame()); });
  }
  return frames;
}

// One stream of `count` frames with faults; `intact` are the frames no fault touched.
struct DamagedStream {
  std::vector<std::byte> bytes;
  std::vector<BoardFrame> sent, intact;
};
DamagedStream damaged_stream(std::size_t count, double drop, double insert) {
  DamagedStream stream;
  Dice dice(3, 3);
  for (std::size_t i = 0; i < count; ++i) {
    const BoardFrame frame = random_frame(i);
    stream.sent.push_back(frame);
    bool touched = false;
    for (const std::byte byte : frame_bytes(frame)) {
      if (dice.hit(drop)) {
        touched = true;
        continue;
      }
      stream.bytes.push_back(byte);
      if (dice.hit(insert)) {
        touched = true;
        stream.bytes.push_back(static_cast<std::byte>(dice.below(256)));
      }
    }
    if (!touched) stream.intact.push_back(frame);
  }
  return stream;
}

TEST(BoardFrame, LayoutIsThatOfTheBoard) {
  BoardFrame frame;
  frame.samples[0] = 0x0ABC;      // patch 0, row 0, column 0: taxel 0
  frame.samples[5 * 6] = 0x0123;  // column 1, row 2: taxel 6
  frame.slip = 0x0FED;
  const auto bytes = frame_bytes(frame);
  EXPECT_EQ(bytes.size(), 164U);
  EXPECT_EQ(bytes[0], std::byte{0x24});
  EXPECT_EQ(bytes[1], std::byte{0x0A});
  EXPECT_EQ(bytes[2], std::byte{0xBC});
  EXPECT_EQ(bytes[161], std::byte{0x0F});
  EXPECT_EQ(bytes[162], std::byte{0xED});
  EXPECT_EQ(bytes[163], std::byte{0x21});
  EXPECT_EQ(frame.taxel(6), 0x0123);
  BoardDecoder decoder;
  decoder.push(bytes, [](const DecodedFrame& found) { EXPECT_EQ(found.values[6], 0x0123 * (3.3F / 4096)); });
  EXPECT_EQ(decoder.frame(), frame);
}

TEST(BoardFrame, EveryHighByteIsChecked) {
  for (std::size_t at = 1; at <= 161; at += 2) {
    auto bytes = frame_bytes(random_frame(1));
    bytes[at] |= std::byte{0x10};
    BoardDecoder decoder;
    EXPECT_TRUE(decode_board(decoder, bytes, 164).empty()) << "high byte at " << at;
  }
}

TEST(BoardDecoder, DiscardedBytesAreFramesUpToAFewOfACable) {
  for (const auto& [bytes, frames] :
       {std::pair(0U, 0U), {1U, 0U}, {80U, 1U}, {163U, 1U}, {164U, 1U}, {165U, 1U}, {327U, 2U}}) {
    BoardDecoder decoder;
    std::vector<std::byte> stream(bytes);
    const std::vector<std::byte> frame = frame_bytes(random_frame(1));
    stream.insert(stream.end(), frame.begin(), frame.end());
    std::vector<std::uint32_t> damaged;
    decoder.push(stream, [&](const DecodedFrame& found) { damaged.push_back(found.damaged); });
    EXPECT_EQ(damaged, std::vector{frames}) << bytes;
  }
}

TEST(BoardDecoder, FlagsAFlippedHighBitOnceAndAcceptsALastingChange) {
  BoardDecoder decoder;
  const auto jump = [&](const BoardFrame& frame) {
    bool jumps = false;
    decoder.push(frame_bytes(frame), [&](const DecodedFrame& found) { jumps = found.jump; });
    return jumps;
  };
  BoardFrame frame;
  frame.samples.fill(3000);
  EXPECT_FALSE(jump(frame));
  BoardFrame flipped = frame;
  flipped.samples[10] ^= 0x400;
  EXPECT_TRUE(jump(flipped));
  EXPECT_FALSE(jump(frame));
  frame.samples[5] = 2000;
  int flagged = 0;
  for (int i = 0; i < 10; ++i) flagged += jump(frame) ? 1 : 0;
  EXPECT_EQ(flagged, 3);
}

TEST(BoardDecoder, PiecesOfAnySizeGiveTheSameFrames) {
  const DamagedStream stream = damaged_stream(200, 0, 0);
  for (const std::size_t piece : {1U, 7U, 163U, 164U, 165U, 4096U}) {
    BoardDecoder decoder;
    EXPECT_EQ(decode_board(decoder, stream.bytes, piece), stream.sent) << "pieces of " << piece;
    EXPECT_EQ(decoder.counters().discarded_bytes, 0U);
  }
}

TEST(BoardDecoder, RecoversEveryUndamagedFrameAtAThousandthDroppedBytes) {
  const DamagedStream stream = damaged_stream(20000, 1e-3, 0);
  BoardDecoder decoder;
  const std::vector<BoardFrame> got = decode_board(decoder, stream.bytes, 164);
  std::size_t found = 0;
  for (const BoardFrame& frame : got) found += found < stream.intact.size() && frame == stream.intact[found];
  RecordProperty("undamaged", static_cast<int>(stream.intact.size()));
  RecordProperty("recovered", static_cast<int>(found));
  EXPECT_EQ(found, stream.intact.size());
  EXPECT_EQ(got.size(), stream.intact.size()) << "a damaged frame passed the checks";
  EXPECT_LT(stream.intact.size(), 18000U) << "the faults were not injected";
}

TEST(BoardDecoder, AcceptsHardlyAnyWrongFrameUnderMixedFaults) {
  const DamagedStream stream = damaged_stream(20000, 1e-3, 1e-3);
  BoardDecoder decoder;
  const std::vector<BoardFrame> got = decode_board(decoder, stream.bytes, 1000);
  std::size_t next = 0, wrong = 0;
  for (const BoardFrame& frame : got) {
    std::size_t at = next;
    while (at < stream.sent.size() && at < next + 50 && !(stream.sent[at] == frame)) ++at;
    if (at < stream.sent.size() && stream.sent[at] == frame) {
      next = at + 1;
    } else {
      ++wrong;
    }
  }
  RecordProperty("wrong", static_cast<int>(wrong));
  RecordProperty("accepted", static_cast<int>(got.size()));
  EXPECT_LE(static_cast<double>(wrong), 1e-3 * static_cast<double>(got.size()));
  EXPECT_GE(got.size(), stream.intact.size());
}

}  // namespace supertac::frame_decoder_test
