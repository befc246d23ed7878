#include "data/samples/split.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "data/plates/random_plate.h"
#include "data/samples/batching.h"
#include "io/hash.h"

namespace supertac {
namespace {

constexpr double kTestShare = 0.2;
constexpr std::uint64_t kWindowStream = 0, kPlateStream = 1, kPassStream = 2;

constexpr std::array<std::pair<const char*, SplitKind>, 5> kNames{{{"window", SplitKind::window},
                                                                   {"pass", SplitKind::pass},
                                                                   {"trial", SplitKind::trial},
                                                                   {"texture", SplitKind::texture},
                                                                   {"none", SplitKind::none}}};

enum class Side : std::uint8_t { neither, train, test };

// Numbers of the passes that have windows, by plate in alphabetical order.
std::map<std::string, std::vector<std::size_t>> passes_by_plate(const WindowSet& windows) {
  std::map<std::string, std::vector<std::size_t>> plates;
  for (std::size_t p = 0; p < windows.passes().size(); ++p)
    if (windows.passes()[p].windows > 0 && !windows.passes()[p].aside)
      plates[windows.passes()[p].plate].push_back(p);
  return plates;
}

std::size_t test_count(std::size_t count) {
  return std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(kTestShare * static_cast<double>(count))));
}

std::vector<Side> split_passes(const WindowSet& windows, std::uint64_t seed) {
  std::vector<Side> sides(windows.passes().size(), Side::train);
  std::uint64_t stream = kPassStream;
  for (const auto& [plate, passes] : passes_by_plate(windows)) {
    if (passes.size() < 2)
      throw std::invalid_argument("split pass: plate '" + plate +
                                  "' has one pass with windows, needs two: one to train on, one to test on");
    const EpochOrder order(passes.size(), seed, stream++);
    for (std::size_t i = 0; i < test_count(passes.size()); ++i) sides[passes[order[i]]] = Side::test;
  }
  return sides;
}

std::vector<Side> split_trials(const WindowSet& windows) {
  std::vector<Side> sides;
  for (const WindowSet::Pass& pass : windows.passes())
    sides.push_back(pass.aside || pass.trial == 1 ? Side::train
                    : pass.trial == 2             ? Side::test
                                                  : Side::neither);
  return sides;
}

std::vector<Side> split_plates(const WindowSet& windows, std::uint64_t seed, const std::string& leave_out) {
  std::vector<Side> sides(windows.passes().size(), Side::train);
  const auto plates = passes_by_plate(windows);
  if (plates.size() < 2)
    throw std::invalid_argument("split texture: the data has " + std::to_string(plates.size()) +
                                " plate, needs two: one to train on, one to test on");
  const auto drawn = std::next(plates.begin(),
                               static_cast<std::ptrdiff_t>(EpochOrder(plates.size(), seed, kPlateStream)[0]));
  const auto held_out = leave_out.empty() ? drawn : plates.find(leave_out);
  if (held_out == plates.end())
    throw std::invalid_argument("split texture: the data has no windows of plate '" + leave_out +
                                "' to leave out");
  const Plate& tested = windows.plate(held_out->second.front());
  for (std::size_t pass = 0; pass < sides.size(); ++pass)
    if (windows.passes()[pass].windows > 0 && resemble(windows.plate(pass), tested))
      sides[pass] = Side::neither;
  for (const std::size_t pass : held_out->second) sides[pass] = Side::test;
  return sides;
}

Split split_windows(const WindowSet& windows, std::uint64_t seed) {
  std::vector<std::uint32_t> own;  // not set aside
  for (std::uint32_t i = 0; i < windows.size(); ++i)
    if (!windows.passes()[windows.pass_of(i)].aside) own.push_back(i);
  if (own.size() < 2)
    throw std::invalid_argument("split window: the data has " + std::to_string(own.size()) +
                                " window, needs two: one to train on, one to test on");
  const EpochOrder order(own.size(), seed, kWindowStream);
  std::vector<bool> tested(windows.size(), false);
  for (std::size_t i = 0; i < test_count(own.size()); ++i) tested[own[order[i]]] = true;
  Split split;
  for (std::uint32_t i = 0; i < windows.size(); ++i) (tested[i] ? split.test : split.train).push_back(i);
  return split;
}

Split split_by_pass(const WindowSet& windows, const std::vector<Side>& sides) {
  Split split;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const Side side = sides[windows.pass_of(i)];
    if (side != Side::neither)
      (side == Side::test ? split.test : split.train).push_back(static_cast<std::uint32_t>(i));
  }
  return split;
}

// Hash of every window of one pass in constant time each: a polynomial in kBase over the hashes of its
// frames, modulo 2^64, as a difference of prefix sums.
class PassHashes {
 public:
  PassHashes(std::span<const float> samples, std::size_t signals, std::size_t timesteps)
      : timesteps_(timesteps) {
    const std::size_t frames = samples.size() / signals;
    for (std::size_t t = 0; t < timesteps; ++t) power_ *= kBase;
    prefix_.push_back(0);
    std::uint64_t before = 0;
    for (std::size_t f = 0; f < frames; ++f) {
      Hash hash;
      for (std::size_t k = 0; k < signals; ++k) hash.add(samples[f * signals + k]);
      prefix_.push_back(prefix_.back() * kBase + hash.value());
      equal_.push_back(f > 0 && hash.value() == before ? equal_.back() + 1 : 1);
      before = hash.value();
    }
  }
  std::uint64_t window(std::size_t last) const {
    return prefix_[last + 1] - prefix_[last + 1 - timesteps_] * power_;
  }
  bool changes(std::size_t last) const { return equal_[last] < timesteps_; }

 private:
  static constexpr std::uint64_t kBase = 0xd1342543de82ef95ULL;  // odd
  std::size_t timesteps_;
  std::uint64_t power_ = 1;
  std::vector<std::uint64_t> prefix_;
  std::vector<std::uint32_t> equal_;  // frames up to here that are all the same
};

std::vector<std::uint64_t> hash_windows(const WindowSet& windows, std::vector<bool>& changes) {
  std::vector<std::uint64_t> hashes(windows.size());
  changes.resize(windows.size());
  for (std::size_t p = 0; p < windows.passes().size(); ++p) {
    const WindowSet::Pass& pass = windows.passes()[p];
    const PassHashes of_pass(windows.track(p), windows.array().signals(),
                             static_cast<std::size_t>(windows.timesteps()));
    for (std::size_t i = pass.first_window; i < pass.first_window + pass.windows; ++i) {
      hashes[i] = of_pass.window(windows.frame_of(i));
      changes[i] = of_pass.changes(windows.frame_of(i));
    }
  }
  return hashes;
}

std::size_t count_overlapping(const WindowSet& windows, const Split& split) {
  const auto timesteps = static_cast<std::size_t>(windows.timesteps());
  const auto touches = [&](std::size_t a, std::size_t b) {
    const std::size_t fa = windows.frame_of(a), fb = windows.frame_of(b);
    return windows.pass_of(a) == windows.pass_of(b) && (fa > fb ? fa - fb : fb - fa) < timesteps;
  };
  std::size_t count = 0;
  for (const std::uint32_t i : split.test) {
    // Indices follow pass and time, so the nearest training windows are the neighbours in the list.
    const auto after = std::lower_bound(split.train.begin(), split.train.end(), i);
    const bool shares = (after != split.train.end() && touches(i, *after)) ||
                        (after != split.train.begin() && touches(i, *std::prev(after)));
    count += shares ? 1 : 0;
  }
  return count;
}

std::set<std::int64_t> test_groups(const PairSet& pairs, std::uint64_t seed) {
  std::set<std::int64_t> all;
  for (std::size_t i = 0; i < pairs.size(); ++i) all.insert(pairs.group(i));
  if (!pairs.grouped() || all.size() < 2)
    throw std::invalid_argument(
        "split group: the file needs a tensor 'group' with two groups, one to train on, one to test on; "
        "without one use split pair");
  const std::vector<std::int64_t> ordered(all.begin(), all.end());
  const EpochOrder order(ordered.size(), seed, 0);
  std::set<std::int64_t> tested;
  for (std::size_t i = 0; i < test_count(ordered.size()); ++i) tested.insert(ordered[order[i]]);
  return tested;
}

}  // namespace

SplitKind split_kind(const std::string& name) {
  for (const auto& [known, kind] : kNames)
    if (name == known) return kind;
  throw std::invalid_argument("split: expects window, pass, trial, texture or none, got '" + name + "'");
}

std::string name_of(SplitKind kind) {
  for (const auto& [name, known] : kNames)
    if (kind == known) return name;
  throw std::invalid_argument("split: unknown kind");
}

Split make_split(const WindowSet& windows, SplitKind kind, std::uint64_t seed, const std::string& leave_out) {
  Split split;
  switch (kind) {
    case SplitKind::window:
      split = split_windows(windows, seed);
      break;
    case SplitKind::pass:
      split = split_by_pass(windows, split_passes(windows, seed));
      break;
    case SplitKind::trial:
      split = split_by_pass(windows, split_trials(windows));
      break;
    case SplitKind::texture:
      split = split_by_pass(windows, split_plates(windows, seed, leave_out));
      break;
    case SplitKind::none:
      for (std::uint32_t i = 0; i < windows.size(); ++i) {
        split.train.push_back(i);
        if (!windows.passes()[windows.pass_of(i)].aside) split.test.push_back(i);
      }
      break;
  }
  if (split.train.empty() || split.test.empty())
    throw std::invalid_argument("split " + name_of(kind) + ": no window to " +
                                (split.train.empty() ? "train on" : "test on") +
                                (kind == SplitKind::trial ? "; the data needs trials 1 and 2" : ""));
  return split;
}

std::vector<std::uint32_t> without_most_silence(const WindowSet& windows,
                                                std::span<const std::uint32_t> list) {
  constexpr std::size_t kSilentApart = 4;
  std::vector<std::uint32_t> kept;
  std::size_t pass = SIZE_MAX, silent = 0;
  for (const std::uint32_t i : list) {
    if (windows.pass_of(i) != pass) pass = windows.pass_of(i), silent = 0;
    const Plate& plate = windows.plate(pass);
    const bool plain = plate.max_height() == plate.min_height();
    if (windows.may_vary(i) || plain || windows.contact(i) || silent++ % kSilentApart == 0) kept.push_back(i);
  }
  return kept;
}

Split split_pairs(const PairSet& pairs, const std::string& kind, std::uint64_t seed) {
  Split split;
  std::vector<bool> tested(pairs.size());
  if (kind == "group") {
    const std::set<std::int64_t> groups = test_groups(pairs, seed);
    for (std::size_t i = 0; i < pairs.size(); ++i) tested[i] = groups.contains(pairs.group(i));
  } else if (kind == "pair") {
    if (pairs.size() < 2) throw std::invalid_argument("split pair: the file has one pair, needs two");
    const EpochOrder order(pairs.size(), seed, 0);
    for (std::size_t i = 0; i < test_count(pairs.size()); ++i) tested[order[i]] = true;
  } else if (kind != "none") {
    throw std::invalid_argument("split of pairs must be group, pair or none, got \"" + kind + "\"");
  }
  for (std::uint32_t i = 0; i < pairs.size(); ++i) {
    if (kind == "none" || tested[i]) split.test.push_back(i);
    if (!tested[i]) split.train.push_back(i);
  }
  return split;
}

Leakage find_leakage(const WindowSet& windows, const Split& split) {
  std::vector<bool> changes;
  const std::vector<std::uint64_t> hashes = hash_windows(windows, changes);
  std::unordered_map<std::uint64_t, std::uint32_t> trained;  // hash to the first training window that has it
  std::vector<std::uint64_t> repeated;                       // hashes of more than one training window
  for (const std::uint32_t i : split.train)
    if (changes[i] && !trained.emplace(hashes[i], i).second) repeated.push_back(hashes[i]);
  std::sort(repeated.begin(), repeated.end());
  Leakage leakage{.overlapping = count_overlapping(windows, split)};
  for (const std::uint32_t i : split.test) {
    const auto found = changes[i] ? trained.find(hashes[i]) : trained.end();
    if (found == trained.end()) continue;
    const bool elsewhere =
        found->second != i || std::binary_search(repeated.begin(), repeated.end(), hashes[i]);
    leakage.duplicated += elsewhere ? 1 : 0;
  }
  return leakage;
}

std::string fingerprint(const Split& split) {
  Hash hash(split.train.size());
  for (const auto* side : {&split.train, &split.test})
    for (const std::uint32_t i : *side) hash.add(std::uint64_t{i} + 1);
  return hash.hex();
}

std::vector<std::uint32_t> spread(std::span<const std::uint32_t> list, std::size_t count) {
  std::vector<std::uint32_t> chosen(std::min(count, list.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = list[i * list.size() / chosen.size()];
  return chosen;
}

}  // namespace supertac
