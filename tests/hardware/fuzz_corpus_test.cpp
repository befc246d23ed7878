// The fuzzers' corpora as regression tests, in every build: what must hold for the frame decoder and the
// Marlin link on any bytes. The journal's and the STL reader's are headers, for they have other users.
#include "data/frames/binary_decoder.h"
#include "hardware/printers/printer.h"
#include "tests/fuzz/corpus.h"
#include "tests/fuzz/journal_properties.h"
#include "tests/hardware/fake_port.h"
#include "tests/support/test.h"

namespace supertac::fuzz_corpus_test {

/// The first byte chooses the size of the pieces, the rest is the stream. Every byte is in a frame,
/// discarded, or still pending; pieces change nothing; every frame's samples have 12 bits. Throws
/// std::logic_error otherwise.
void check_frame_decoder(std::span<const std::byte> input) {
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

/// The first byte says how many lines are answered `ok` before the script begins, which answers each with its
/// text up to the next 0 byte. Whatever comes then, the drivers end with a result or a typed error, in
/// bounded time, and send nothing to a firmware that has halted. Throws std::logic_error otherwise.
void check_marlin_replies(std::span<const std::byte> input) {
  if (input.empty()) return;
  int polite = std::to_integer<int>(input[0]) % 16;
  std::string script = as_text(input.subspan(1));
  ScriptedPrinter port([&](const std::string& line) -> std::string {
    if (polite-- > 0)
      return line.find("M115") != line.npos ? "FIRMWARE_NAME:Marlin\nCap:EMERGENCY_PARSER:0\nok\n" : "ok\n";
    const std::string answer = script.substr(0, script.find('\0'));
    script.erase(0, answer.size() + 1);
    return answer;
  });
  Printer printer(port);
  const double begin = port.now();
  try {
    printer.connect();
    printer.confirm_origin({100, 102, 131});
    printer.start_move({100, 102, 140}, 10);
    (void)printer.sample_position();
    printer.finish_move();
    (void)printer.quick_stop();
    printer.lift_out(135);
  } catch (const HardwareError&) {
  }
  if (printer.link().halted()) {
    const int writes = port.writes();
    try {
      printer.link().command("M114");
      throw std::logic_error("marlin link: a halted firmware took a command");
    } catch (const PrinterHalted&) {
    }
    if (port.writes() != writes) throw std::logic_error("marlin link: something was sent after the halt");
  }
  // A busy firmware may take its time: six seconds for every busy line.
  const double patience = 4000 + 6.0 * static_cast<double>(input.size());
  if (port.now() - begin > patience) throw std::logic_error("marlin link: it waited too long");
}

TEST(FuzzCorpus, FrameDecoder) { EXPECT_GE(replay("frame_decoder", check_frame_decoder), 62); }

TEST(FuzzCorpus, MarlinReplies) { EXPECT_GE(replay("marlin_reply", check_marlin_replies), 40); }

TEST(FuzzCorpus, Journals) { EXPECT_GE(replay("journal", check_journal), 26); }

}  // namespace supertac::fuzz_corpus_test
