// Throughput of the frame decoder, on a clean stream and with faults. The board sends 0.165 MB/s.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "hardware/boards/frame_decoder.h"
#include "hardware/virtual_rig/faults.h"

namespace {

std::vector<std::byte> stream_of(std::size_t frames, double fault_rate) {
  supertac::ByteFaults faults(fault_rate, 1, 1);
  supertac::Dice dice(2, 2);
  std::vector<std::byte> stream;
  for (std::size_t i = 0; i < frames; ++i) {
    supertac::BoardFrame frame;
    for (auto& sample : frame.samples) sample = static_cast<std::uint16_t>(dice.below(4096));
    std::vector<std::byte> bytes(supertac::rig::kFrameBytes);
    supertac::write_frame(frame, std::span<std::byte, supertac::rig::kFrameBytes>(bytes));
    const auto damaged = faults.apply(bytes);
    stream.insert(stream.end(), damaged.begin(), damaged.end());
  }
  return stream;
}

void decode(benchmark::State& state, double fault_rate) {
  const std::vector<std::byte> stream = stream_of(20'000, fault_rate);
  const auto piece = static_cast<std::size_t>(state.range(0));
  for (auto _ : state) {
    supertac::FrameDecoder decoder;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      decoder.push(std::span(stream).subspan(at, std::min(piece, stream.size() - at)),
                   [](const supertac::BoardFrame& frame, std::uint64_t) {
                     benchmark::DoNotOptimize(const_cast<supertac::BoardFrame&>(frame));
                   });
    }
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * stream.size()));
}

}  // namespace

BENCHMARK_CAPTURE(decode, clean, 0.0)->Arg(164)->Arg(4096);
BENCHMARK_CAPTURE(decode, one_per_mille_faults, 1e-3)->Arg(164)->Arg(4096);
BENCHMARK_MAIN();
