#include "data/windows/split.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "data/plates/plate.h"
#include "data/windows/batching.h"
#include "io/numbers/hash.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kTestShare = 0.2;
constexpr std::uint64_t kWindowStream = 0, kPlateStream = 1, kPassStream = 2, kHeldOutStream = 1;
constexpr const char* kTwo = "two, one to train on, one to test on";

constexpr const char* kNames[] = {"window", "pass", "trial", "texture", "group", "none"};  // by SplitKind

enum class Side : std::uint8_t { neither, train, test };

// Numbers of the passes that have windows to test, by plate or group in alphabetical order.
using PassNumbers = std::map<std::string, std::vector<std::size_t>>;

PassNumbers passes_by(std::string WindowSet::Pass::*key, const WindowSet& windows) {
  PassNumbers numbers;
  for (std::size_t p = 0; p < windows.passes().size(); ++p) {
    const WindowSet::Pass& pass = windows.passes()[p];
    if (pass.windows > 0 && !pass.use.training_only) numbers[pass.*key].push_back(p);
  }
  return numbers;
}

std::size_t test_count(std::size_t count) {
  return std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(kTestShare * static_cast<double>(count))));
}

// The first `count` names of a random order.
std::vector<std::string> drawn(const PassNumbers& all, std::size_t count, std::uint64_t seed,
                               std::uint64_t stream) {
  const EpochOrder order(all.size(), seed, stream);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i)
    names.push_back(std::next(all.begin(), static_cast<std::ptrdiff_t>(order[i]))->first);
  return names;
}

std::vector<Side> split_passes(const WindowSet& windows, std::uint64_t seed) {
  std::vector<Side> sides(windows.passes().size(), Side::train);
  std::uint64_t stream = kPassStream;
  for (const auto& [plate, passes] : passes_by(&WindowSet::Pass::plate, windows)) {
    if (passes.size() < 2)
      throw std::invalid_argument(refusal("split pass", "passes with windows over " + in_quotes(plate), kTwo,
                                          std::to_string(passes.size())));
    const EpochOrder order(passes.size(), seed, stream++);
    for (std::size_t i = 0; i < test_count(passes.size()); ++i) sides[passes[order[i]]] = Side::test;
  }
  return sides;
}

std::vector<Side> split_trials(const WindowSet& windows) {
  std::vector<Side> sides;
  for (const WindowSet::Pass& pass : windows.passes()) {
    if (pass.windows > 0 && pass.trial == 0)
      throw std::invalid_argument(
          refusal("split trial", "pass " + std::to_string(pass.pass) + " over " + in_quotes(pass.plate),
                  "a trial", "none; use split group or pass, or record it with one"));
    sides.push_back(pass.use.training_only || pass.trial == 1 ? Side::train : Side::test);
  }
  return sides;
}

std::vector<Side> split_groups(const WindowSet& windows, std::uint64_t seed,
                               std::vector<std::string> leave_out) {
  const PassNumbers groups = passes_by(&WindowSet::Pass::group, windows);
  if (groups.size() < 2 || groups.contains(""))
    throw std::invalid_argument(
        refusal("split group", "metadata 'group'",
                "every recording to have it, and two groups, one to train on, one to test on",
                groups.contains("") ? "recordings without: use split pass" : "one: use split window"));
  std::vector<Side> sides(windows.passes().size(), Side::train);
  if (leave_out.empty()) leave_out = drawn(groups, test_count(groups.size()), seed, kWindowStream);
  for (const std::string& name : leave_out) {
    if (!groups.contains(name))
      throw std::invalid_argument(refusal(
          "split group", "leave_out",
          "one of " + joined(groups, ", ", [](const auto& group) { return group.first; }), in_quotes(name)));
    for (const std::size_t p : groups.at(name)) sides[p] = Side::test;
  }
  return sides;
}

std::vector<Side> split_plates(const WindowSet& windows, std::uint64_t seed,
                               std::vector<std::string> leave_out) {
  std::vector<Side> sides(windows.passes().size(), Side::train);
  const PassNumbers plates = passes_by(&WindowSet::Pass::plate, windows);
  if (plates.size() < 2 && leave_out.empty())
    throw std::invalid_argument(refusal("split texture", "plates", kTwo, std::to_string(plates.size())));
  if (leave_out.empty()) leave_out = drawn(plates, 1, seed, kPlateStream);
  for (const std::string& name : leave_out) {
    const auto held_out = plates.find(name);
    if (held_out == plates.end())
      throw std::invalid_argument(
          refusal("split texture", "leave_out", "a plate with windows in the data", in_quotes(name)));
    const Plate& tested = windows.plate(held_out->second.front());
    for (std::size_t pass = 0; pass < sides.size(); ++pass)
      if (sides[pass] == Side::train && windows.passes()[pass].windows > 0 &&
          resemble(windows.plate(pass), tested))
        sides[pass] = Side::neither;
    for (const std::size_t pass : held_out->second) sides[pass] = Side::test;
  }
  return sides;
}

Split split_windows(const WindowSet& windows, std::uint64_t seed) {
  std::vector<std::uint32_t> own;  // not for training only
  for (std::uint32_t i = 0; i < windows.size(); ++i)
    if (!windows.passes()[windows.pass_of(i)].use.training_only) own.push_back(i);
  if (own.size() < 2)
    throw std::invalid_argument(refusal("split window", "windows", kTwo, std::to_string(own.size())));
  const EpochOrder order(own.size(), seed, kWindowStream);
  std::vector<bool> tested(windows.size(), false);
  for (std::size_t i = 0; i < test_count(own.size()); ++i) tested[own[order[i]]] = true;
  Split split;
  for (std::uint32_t i = 0; i < windows.size(); ++i) (tested[i] ? split.test : split.train).push_back(i);
  return split;
}

Split split_by_pass(const WindowSet& windows, const std::vector<Side>& sides) {
  Split split;
  for (std::size_t p = 0; p < sides.size(); ++p) {
    const WindowSet::Pass& pass = windows.passes()[p];
    for (std::size_t i = 0; sides[p] != Side::neither && i < pass.windows; ++i)
      (sides[p] == Side::test ? split.test : split.train)
          .push_back(static_cast<std::uint32_t>(pass.first_window + i));
  }
  return split;
}

Split split_of(const WindowSet& windows, SplitKind kind, std::uint64_t seed,
               const std::vector<std::string>& leave_out) {
  switch (kind) {
    case SplitKind::window:
      return split_windows(windows, seed);
    case SplitKind::pass:
      return split_by_pass(windows, split_passes(windows, seed));
    case SplitKind::trial:
      return split_by_pass(windows, split_trials(windows));
    case SplitKind::texture:
      return split_by_pass(windows, split_plates(windows, seed, leave_out));
    case SplitKind::group:
      return split_by_pass(windows, split_groups(windows, seed, leave_out));
    case SplitKind::none:
      break;
  }
  Split split;
  for (std::uint32_t i = 0; i < windows.size(); ++i) {
    split.train.push_back(i);
    if (!windows.passes()[windows.pass_of(i)].use.training_only) split.test.push_back(i);
  }
  return split;
}

}  // namespace

SplitKind split_kind(const std::string& name) {
  const auto found = std::ranges::find(kNames, name);
  if (found == std::end(kNames))
    throw std::invalid_argument(
        refusal("split", "name", "window, pass, trial, texture, group or none", in_quotes(name)));
  return static_cast<SplitKind>(found - std::begin(kNames));
}

std::string name_of(SplitKind kind) { return kNames[static_cast<std::size_t>(kind)]; }

Split make_split(const WindowSet& windows, SplitKind kind, std::uint64_t seed,
                 const std::vector<std::string>& leave_out) {
  Split split = split_of(windows, kind, seed, leave_out);
  if (split.train.empty() || split.test.empty())
    throw std::invalid_argument(refusal(
        "split " + name_of(kind), "windows",
        split.train.empty() ? "one or more to train on" : "one or more to test on",
        kind == SplitKind::trial     ? "none; the data needs trials 1 and 2; split pass or group does without"
        : kind == SplitKind::texture ? "none; the data has nothing unlike what is left out: train beside "
                                       "random plates, score with split none"
                                     : "none"));
  return split;
}

std::vector<std::uint32_t> hold_out_group(const WindowSet& windows, Split& split, std::uint64_t seed) {
  std::set<std::string> trained;
  const auto pass_of = [&](std::uint32_t i) -> const WindowSet::Pass& {
    return windows.passes()[windows.pass_of(i)];
  };
  for (const std::uint32_t i : split.train)
    if (!pass_of(i).use.training_only) trained.insert(pass_of(i).group);
  if (trained.size() < 3) return {};
  const std::string name = *std::next(
      trained.begin(), static_cast<std::ptrdiff_t>(EpochOrder(trained.size(), seed, kHeldOutStream)[0]));
  std::vector<std::uint32_t> train, held_out;
  for (const std::uint32_t i : split.train)
    (!pass_of(i).use.training_only && pass_of(i).group == name ? held_out : train).push_back(i);
  split.train = std::move(train);
  return held_out;
}

std::vector<std::uint32_t> subsample_no_contact(const WindowSet& windows, std::vector<std::uint32_t> list) {
  constexpr std::size_t kSilentApart = 4;
  std::size_t end = 0, silent = 0;  // of the pass
  bool whole = true;
  const auto is_left_out = [&](std::uint32_t i) {
    if (i >= end) {
      const std::size_t number = windows.pass_of(i);
      const WindowSet::Pass& pass = windows.passes()[number];
      const Plate& plate = windows.plate(number);
      end = pass.first_window + pass.windows, silent = 0;
      whole = pass.use.augmentable || plate.max_height() == plate.min_height();
    }
    return !whole && !windows.contact(i) && silent++ % kSilentApart != 0;
  };
  // Not std::erase_if, which may copy the predicate.
  std::size_t kept = 0;
  for (const std::uint32_t i : list)
    if (!is_left_out(i)) list[kept++] = i;
  list.resize(kept);
  return list;
}

std::size_t count_overlapping(const WindowSet& windows, const Split& split) {
  const std::size_t timesteps = windows.frames();
  std::size_t count = 0, begin = 0, end = 0;  // windows of the pass
  const auto touches = [&](std::uint32_t a, std::uint32_t b) {
    if (b < begin || b >= end) return false;
    const std::size_t fa = windows.frame_of(a), fb = windows.frame_of(b);
    return (fa > fb ? fa - fb : fb - fa) < timesteps;
  };
  auto after = split.train.begin();
  for (const std::uint32_t i : split.test) {
    if (i >= end) {
      const WindowSet::Pass& pass = windows.passes()[windows.pass_of(i)];
      begin = pass.first_window, end = begin + pass.windows;
    }
    // Indices follow pass and time, so the nearest training windows are the neighbours in the list.
    while (after != split.train.end() && *after < i) ++after;
    const bool shares = (after != split.train.end() && touches(i, *after)) ||
                        (after != split.train.begin() && touches(i, *std::prev(after)));
    count += shares ? 1 : 0;
  }
  return count;
}

std::string fingerprint(const Split& split) {
  Hash hash(split.train.size());
  for (const auto* side : {&split.train, &split.test})
    for (const std::uint32_t i : *side) hash.add(std::uint64_t{i} + 1);
  return hash.hex();
}

std::vector<std::uint32_t> evenly_spaced(std::span<const std::uint32_t> list, std::size_t count) {
  std::vector<std::uint32_t> chosen(std::min(count, list.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = list[i * list.size() / chosen.size()];
  return chosen;
}

}  // namespace supertac
