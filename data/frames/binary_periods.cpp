// After how many bytes the bytes of a stream return.
#include <algorithm>
#include <cmath>

#include "data/frames/binary_columns.h"
#include "io/numbers/median.h"

namespace supertac {
namespace {

constexpr std::size_t kShortest = 4, kLongest = 20'000, kRows = 6, kMostPeriods = 4, kShortlist = 300;
constexpr std::size_t kBlock = 4096, kBlocks = 12;  // of the bytes that all periods are tried on
constexpr double kNotable = 0.5, kSigmas = 4;

// A shape that compilers make vectors of.
std::size_t equal_bytes(const unsigned char* a, const unsigned char* b, std::size_t count) {
  constexpr std::size_t kLanes = 64;
  std::size_t total = 0, i = 0;
  while (i + kLanes <= count) {
    unsigned char sums[kLanes] = {};
    for (std::size_t n = 0; n < 255 && i + kLanes <= count; ++n, i += kLanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        sums[lane] = static_cast<unsigned char>(sums[lane] + (a[i + lane] == b[i + lane] ? 1 : 0));
    for (const unsigned char sum : sums) total += sum;
  }
  for (; i < count; ++i) total += a[i] == b[i] ? 1 : 0;
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

// Of lags in ascending order those after which notably more returns than usual. A multiple stays only if more
// returns after it than after what it is a multiple of.
std::vector<Lag> notable(const std::vector<Lag>& lags, double usual) {
  const double most = std::ranges::max_element(lags, {}, &Lag::share)->share;
  std::vector<Lag> kept;
  for (const Lag& lag : lags)
    if (lag.share - usual >= kNotable * (most - usual) && std::ranges::none_of(kept, [&](const Lag& k) {
          return lag.period % k.period == 0 && lag.share < k.share + kSigmas * lag.sigma;
        }))
      kept.push_back(lag);
  return kept;
}

}  // namespace

std::vector<std::size_t> periods_of(Bytes bytes) {
  const std::size_t longest = std::min(kLongest, bytes.size() / kRows);
  if (longest < kShortest) return {};
  std::vector<Lag> lags;
  const std::size_t room = bytes.size() - longest;
  for (std::size_t p = kShortest; p <= longest; ++p) {
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
  if (lags.size() > kShortlist) lags.resize(kShortlist);
  std::ranges::sort(lags, {}, &Lag::period);
  for (Lag& lag : lags) {
    const std::size_t count = bytes.size() - lag.period;
    lag = lag_of(lag.period, equal_bytes(&bytes[0], &bytes[lag.period], count), count);
  }
  lags = notable(lags, usual);
  std::ranges::sort(lags, std::greater(), &Lag::share);
  std::vector<std::size_t> periods;
  for (const Lag& lag : lags)
    if (periods.size() < kMostPeriods) periods.push_back(lag.period);
  return periods;
}

Stretch stretch_of(Bytes bytes, std::size_t period) {
  const std::size_t rows = bytes.size() / period;
  std::vector<double> shares;
  for (std::size_t k = 0; k + 1 < rows; ++k)
    shares.push_back(static_cast<double>(equal_bytes(&bytes[k * period], &bytes[(k + 1) * period], period)));
  if (shares.empty()) return {period, 0, 0};
  const double enough = 0.6 * median(std::vector(shares));
  Stretch best{period, 0, 0};
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

}  // namespace supertac
