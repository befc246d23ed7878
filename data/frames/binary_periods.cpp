// After how many bytes the bytes of a stream return.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "data/frames/binary_columns.h"
#include "data/frames/binary_decoder.h"
#include "io/numbers/median.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kBlock = 4096, kBlocks = 12;  // of the bytes that all periods are tried on

std::size_t equal_bytes(const unsigned char* a, const unsigned char* b, std::size_t count) {
  unsigned total = 0;  // of 32 bits, which compilers add side by side
  for (std::size_t i = 0; i < count; ++i) total += a[i] == b[i] ? 1U : 0U;
  return total;
}

struct Lag {
  std::size_t period;
  double share, sigma;  // of the bytes that return
};

Lag lag_of(std::size_t period, std::size_t equal, std::size_t count) {
  const double n = static_cast<double>(count), share = static_cast<double>(equal) / n;
  return {period, share, std::sqrt(std::max(share * (1 - share), 1e-6) / n)};
}

// Of lags in ascending order those after which at least half as much more returns than usual as after the
// best. A multiple stays only if more returns after it, by four standard errors, than after what it is a
// multiple of, and none after a lag by which every byte returns: nothing is left to explain.
std::vector<Lag> notable(const std::vector<Lag>& lags, double usual) {
  const double most = std::ranges::max_element(lags, {}, &Lag::share)->share;
  std::vector<Lag> kept;
  for (const Lag& lag : lags)
    if (lag.share - usual >= 0.5 * (most - usual) && std::ranges::none_of(kept, [&](const Lag& k) {
          return k.share == 1 || (lag.period % k.period == 0 && lag.share < k.share + 4 * lag.sigma);
        }))
      kept.push_back(lag);
  return kept;
}

}  // namespace

std::vector<std::size_t> periods_of(Bytes bytes) {
  const std::size_t longest = std::min<std::size_t>(20'000, bytes.size() / 6);  // it returns five times
  if (longest < 4) return {};
  std::vector<Lag> lags;
  const std::size_t room = bytes.size() - longest;
  for (std::size_t p = 4; p <= longest; ++p) {
    if (room <= kBlock * kBlocks) {
      lags.push_back(lag_of(p, equal_bytes(&bytes[0], &bytes[p], room), room));
      continue;
    }
    std::size_t equal = 0;
    for (std::size_t n = 0; n < kBlocks; ++n) {
      const std::size_t from = n * (room - kBlock) / (kBlocks - 1);
      equal += equal_bytes(&bytes[from], &bytes[from + p], kBlock);
    }
    lags.push_back(lag_of(p, equal, kBlock * kBlocks));
  }
  std::vector<double> shares;
  for (const Lag& lag : lags) shares.push_back(lag.share);
  const double usual = median(shares);
  lags = notable(lags, usual);
  std::ranges::sort(lags, std::greater(), &Lag::share);
  if (lags.size() > 300) lags.resize(300);
  std::ranges::sort(lags, {}, &Lag::period);
  for (Lag& lag : lags) {
    const std::size_t count = bytes.size() - lag.period;
    lag = lag_of(lag.period, equal_bytes(&bytes[0], &bytes[lag.period], count), count);
  }
  lags = notable(lags, usual);
  std::ranges::sort(lags, std::greater(), &Lag::share);
  std::vector<std::size_t> periods;
  for (const Lag& lag : lags)
    if (periods.size() < 4) periods.push_back(lag.period);
  return periods;
}

ByteStretch stretch_of(Bytes bytes, std::size_t period) {
  const std::size_t rows = bytes.size() / period;
  std::vector<double> shares;
  for (std::size_t k = 0; k + 1 < rows; ++k)
    shares.push_back(static_cast<double>(equal_bytes(&bytes[k * period], &bytes[(k + 1) * period], period)));
  if (shares.empty()) return {period, 0, 0};
  const double enough = 0.6 * median(std::vector(shares));
  ByteStretch best{period, 0, 0};
  double sum = 0, most = 0;
  std::size_t begin = 0;
  for (std::size_t k = 0; k < shares.size(); ++k) {
    if (sum <= 0) sum = 0, begin = k;
    // What falls far short is a loss, not a press: no gain outweighs it.
    sum = shares[k] < 0.5 * enough ? 0 : sum + shares[k] - enough;
    if (sum > most) most = sum, best = {period, begin * period, k - begin + 2};
  }
  return best;
}

std::vector<double> bits_of_starts(std::span<const Heard> heard, std::size_t first_byte,
                                   const ByteStretch& stretch, double seconds, std::size_t bytes) {
  const std::size_t period = stretch.period;
  std::vector<std::size_t> counts(period);
  std::size_t all = 0, at = 0;
  double before = -1e9;
  const double pause = 0.3 * seconds * static_cast<double>(period) / static_cast<double>(bytes);
  for (const Heard& chunk : heard) {
    const bool within =
        at >= first_byte + stretch.begin && at < first_byte + stretch.begin + stretch.rows * period && at > 0;
    if (within && chunk.time_s - before > pause) ++counts[(at - first_byte - stretch.begin) % period], ++all;
    at += chunk.bytes.size(), before = chunk.time_s;
  }
  std::vector<double> bits(period);
  for (std::size_t c = 0; c < period; ++c) {
    const auto in = static_cast<double>(counts[c]), out = static_cast<double>(all - counts[c]);
    bits[c] = bits_of_share(in, out) + out * std::log2(static_cast<double>(period));
  }
  const double least = std::ranges::min(bits);
  for (double& b : bits) b = std::min(b - least, 30.0);
  // Every second time the bytes begin with a frame, and end with one.
  const double by_chance = std::log2(static_cast<double>(period) + 1);
  const std::size_t end = bytes - first_byte - stretch.begin;
  for (std::size_t c = 0; c < period; ++c) {
    if (first_byte + stretch.begin == 0 && c > 0) bits[c] += by_chance;
    if (end < (stretch.rows + 1) * period && (end - c) % period != 0) bits[c] += by_chance;
  }
  return bits;
}

std::string framing_of(Bytes bytes) {
  struct Framing {
    const char* name;
    unsigned char mark, escape, first, second;  // escape: what begins a pair for one byte; what ends it
  };
  for (const auto& [name, mark, escape, first, second] :
       {Framing{"SLIP", 0xC0, 0xDB, 0xDC, 0xDD}, {"HDLC", 0x7E, 0x7D, 0x5D, 0x5E}, {"COBS", 0, 0, 0, 0}}) {
    std::map<std::size_t, std::size_t> sizes, replaced;  // of all frames, and of those with replaced bytes
    std::size_t frames = 0;
    auto at = std::ranges::find(bytes, mark);
    for (auto end = at; at != bytes.end(); at = end) {
      end = std::find(at + 1, bytes.end(), mark);
      if (end == bytes.end() || end == at + 1) continue;
      std::size_t size = 0, pairs = 0;
      bool whole = true;
      for (auto byte = at + 1; byte < end && whole; ++size) {
        const auto left = end - byte;
        const std::size_t block = *byte++;
        if (mark == 0) {  // says where the next zero stood
          whole = static_cast<std::ptrdiff_t>(block) <= left;
          if (whole)
            byte += static_cast<std::ptrdiff_t>(block) - 1, size += block - (block == 255 ? 2 : 1),
                pairs += byte < end ? 1 : 0;
        } else if (block == escape) {
          whole = byte < end && (*byte == first || *byte == second), ++pairs, ++byte;
        }
      }
      ++frames;
      if (whole && size >= 4) ++sizes[size], replaced[size] += pairs > 0 ? 1 : 0;
    }
    for (const auto& [size, count] : sizes)
      if (10 * count > 9 * frames && replaced[size] >= 2) return name;
  }
  return "";
}

bool holds_seven_bits(const BinaryReading& reading, std::span<const Heard> heard) {
  if (bytes_of(reading.format.type) != 2) return false;
  std::vector<int> high(reading.values, -1);
  bool changes = false, eighth = false;
  Sensor sensor;
  sensor.array.rows = 1, sensor.array.columns = static_cast<int>(reading.values),
  sensor.frame = reading.format;
  BinaryDecoder decoder(sensor);
  for (const Heard& chunk : heard)
    decoder.push(std::as_bytes(std::span(chunk.bytes)), [&](const DecodedFrame& frame) {
      for (std::size_t k = 0; k < high.size(); ++k) {
        const int value = static_cast<int>(frame.values[k]),
                  before = std::exchange(high[k], value >> 8 & 0xFF);
        eighth = eighth || (value & 0x80) != 0, changes = changes || (before >= 0 && before != high[k]);
      }
    });
  return changes && !eighth;
}

std::string word_in(Bytes bytes, std::size_t period) {
  std::string longest, word;
  for (std::size_t c = 0; c < 2 * period && c < bytes.size(); ++c) {
    const char byte = static_cast<char>(bytes[c]);
    bool stays = (lower(byte) >= 'a' && lower(byte) <= 'z') || byte == '/' || byte == '_';
    std::size_t changes = 0;  // where a byte is lost, the next one stays there
    for (std::size_t at = c % period + period; stays && at < bytes.size(); at += period)
      changes += bytes[at] != bytes[at - period] ? 1 : 0;
    stays = stays && 20 * changes <= bytes.size() / period;
    word = stays ? word + byte : "";
    const bool varied = std::set(word.begin(), word.end()).size() > 2;
    if (varied && word.size() > std::max<std::size_t>(4, longest.size()) && word.size() <= period)
      longest = word;
  }
  return longest;
}

}  // namespace supertac
