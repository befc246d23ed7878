// Which windows are trained on and which are tested.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"

namespace supertac {

/// How a set of windows is divided:
///   window   a random fifth of all windows is tested. Leaky: neighbours share nearly all frames. Kept to
///            compare with the literature.
///   pass     of each plate a random fifth of its passes (rounded, at least one) is tested: unseen slides.
///   trial    trial 1 is trained on, later trials are tested: other days. Every pass needs a trial.
///   texture  the named plates, or one drawn at random, are tested; the others are trained on, but for
///            those that resemble() one of them, passes for training only included: unseen surfaces.
///   group    a random fifth of the groups (rounded, at least one) is tested: unseen people, objects, days
///            (WindowSet::Pass::group), of which every pass needs one.
///   none     all windows are in both: for models that are tested on other data.
/// Windows of passes for training only (PassUse) are trained on in every kind (but for such as split texture
/// leaves out), and tested in none.
enum class SplitKind { window, pass, trial, texture, group, none };

/// Throws std::invalid_argument listing the names.
SplitKind split_kind(const std::string& name);
std::string name_of(SplitKind kind);

struct Split {
  std::vector<std::uint32_t> train, test;  ///< indices of windows, ascending
};

/// The random choices are EpochOrder(count, seed, stream) with stream 0 for windows and groups, 1 for plates
/// and for a group held out, and 2 + p for the passes of plate p; the first of the order are tested. Plates
/// and groups are counted in alphabetical order, passes as in WindowSet::passes(); those without windows do
/// not count. A pure function of the set, kind and seed; trial and none do not use the seed. `leave_out`: of
/// split texture the plates that are tested, of split group the groups. Throws std::invalid_argument when a
/// side would be empty, saying what the data lacks, or when it has none of that name to leave out.
Split make_split(const WindowSet& windows, SplitKind kind, std::uint64_t seed,
                 const std::vector<std::string>& leave_out = {});

/// Takes the windows of a group, drawn with the seed, out of split.train and gives them back. None, where
/// fewer than two groups would be left to train on.
std::vector<std::uint32_t> hold_out_group(const WindowSet& windows, Split& split, std::uint64_t seed);

/// Of these windows, ascending, drops 75 % of those without contact of passes that are not augmentable
/// (simulated ones over random plates): two of three windows of a whole pass show a flat plate or the air,
/// which is soon learnt. Passes over a plain plate, on which a finger is pressed as hard as elsewhere on a
/// texture, are kept whole. So are recorded ones: without 75 % of their windows without contact a network of
/// four plates drew ghosts on 0.8 % of the flat plate instead of 0.1 %.
std::vector<std::uint32_t> subsample_no_contact(const WindowSet& windows, std::vector<std::uint32_t> list);

/// How many test windows have a frame in common with a training window, by their places.
std::size_t count_overlapping(const WindowSet& windows, const Split& split);

/// 16 hexadecimal digits over both index lists.
std::string fingerprint(const Split& split);

/// `count` elements at even distances in the list, in its order; the whole list when it is not longer.
std::vector<std::uint32_t> evenly_spaced(std::span<const std::uint32_t> list, std::size_t count);

}  // namespace supertac
