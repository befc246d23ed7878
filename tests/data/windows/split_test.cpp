#include "data/windows/split.h"

#include "data/simulation/simulator.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::split_test {

constexpr PassUse kTrainingOnly{.training_only = true};
constexpr PassUse kOneOfMany{.training_only = true, .augmentable = false, .stride = 8};

// Two plates, two trials, four passes of 40 frames: 16 passes with 25 windows each. Every pass has its own
// level.
WindowSet make_set() {
  WindowSet set(wide_settings(16));
  int number = 0;
  for (const char* plate : {"ridges6", "bumps12"})
    for (int trial = 1; trial <= 2; ++trial)
      for (int pass = 1; pass <= 4; ++pass)
        set.add(make_recording({.plate = plate,
                                .trial = trial,
                                .pass = pass,
                                .frames = 40,
                                .level = 1.2F + 0.1F * static_cast<float>(number++)}));
  return set;
}

std::set<std::size_t> passes_of(const WindowSet& set, const std::vector<std::uint32_t>& side) {
  std::set<std::size_t> passes;
  for (const std::uint32_t i : side) passes.insert(set.pass_of(i));
  return passes;
}

/// Of the passes of a side.
std::set<std::string> plates_of(const WindowSet& set, const std::vector<std::uint32_t>& side,
                                std::string WindowSet::Pass::*name = &WindowSet::Pass::plate) {
  std::set<std::string> names;
  for (const std::size_t p : passes_of(set, side)) names.insert(set.passes()[p].*name);
  return names;
}

std::set<std::string> groups_of(const WindowSet& set, const std::vector<std::uint32_t>& side) {
  return plates_of(set, side, &WindowSet::Pass::group);
}

/// Passes of 30 frames, whose groups take turns.
WindowSet set_of_people(int passes, int people) {
  WindowSet set(wide_settings(16));
  for (int pass = 1; pass <= passes; ++pass) {
    Recording recording = make_recording({.pass = pass, .frames = 30});
    recording.metadata["group"] = "person " + std::to_string(pass % people);
    set.add(recording);
  }
  return set;
}

TEST(SplitKind, HasANameBothWays) {
  for (const char* name : {"window", "pass", "trial", "texture", "group", "none"})
    EXPECT_EQ(name_of(split_kind(name)), name);
  EXPECT_REFUSAL("split: name expects window, pass, trial, texture, group or none, got 'trails'",
                 split_kind("trails"));
}

TEST(Split, WindowTestsARandomFifthAndLeaks) {
  const WindowSet set = make_set();
  const Split split = make_split(set, SplitKind::window, 1);
  EXPECT_EQ(split.test.size(), set.size() / 5);
  EXPECT_EQ(split.train.size() + split.test.size(), set.size());
  std::set<std::uint32_t> both(split.train.begin(), split.train.end());
  both.insert(split.test.begin(), split.test.end());
  EXPECT_EQ(both.size(), set.size()) << "each window is on one side";
  EXPECT_EQ(count_overlapping(set, split), split.test.size());  // what makes it the easy one
}

TEST(Split, PassTestsUnseenPassesOfEveryPlate) {
  const WindowSet set = make_set();
  const Split split = make_split(set, SplitKind::pass, 1);
  const auto train = passes_of(set, split.train), test = passes_of(set, split.test);
  EXPECT_EQ(test.size(), 4U);  // a fifth of 8, rounded, of each plate
  EXPECT_EQ(train.size(), 12U);
  for (const std::size_t p : test) EXPECT_FALSE(train.contains(p));
  EXPECT_EQ(plates_of(set, split.test).size(), 2U);
  EXPECT_EQ(count_overlapping(set, split), 0U);
}

TEST(Split, TextureTestsAnUnseenPlate) {
  const WindowSet set = make_set();
  std::set<std::string> held_out;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Split split = make_split(set, SplitKind::texture, seed);
    const auto train = plates_of(set, split.train), test = plates_of(set, split.test);
    ASSERT_EQ(test.size(), 1U);
    ASSERT_FALSE(train.contains(*test.begin()));
    held_out.insert(*test.begin());
  }
  EXPECT_EQ(held_out.size(), 2U);  // the seed chooses
}

// What resembles a plate left out is not trained on either, for training only or not.
TEST(Split, TextureLeavesOutTheNamedPlatesAndTheirLikes) {
  struct Case {
    std::vector<std::string> own, training_only, leave_out;
    std::set<std::string> train;
  };
  const Case cases[] = {{{"3_Bumps", "bumps6", "4_Ridges"}, {"bumps12"}, {"3_Bumps"}, {"bumps6", "4_Ridges"}},
                        {{"3_Bumps", "4_Ridges", "bumps6"},
                         {"bumps12", "ridges9", "bumps8"},
                         {"3_Bumps", "4_Ridges", "bumps6"},
                         {"bumps8"}}};
  for (const auto& [own, training_only, leave_out, train] : cases) {
    WindowSet set(wide_settings(16));
    const auto add = [&](const std::string& plate, const PassUse& use) {
      const float level = 1.0F + static_cast<float>(set.size()) / 100;
      set.add(make_recording({.plate = plate, .frames = 40, .level = level}), ".", use);
    };
    for (const std::string& plate : own) add(plate, {});
    for (const std::string& plate : training_only) add(plate, kTrainingOnly);
    const Split split = make_split(set, SplitKind::texture, 7, leave_out);
    EXPECT_EQ(plates_of(set, split.test), std::set<std::string>(leave_out.begin(), leave_out.end()));
    EXPECT_EQ(plates_of(set, split.train), train);
    EXPECT_REFUSAL("split texture: leave_out expects a plate with windows in the data, got '6_Blob'",
                   make_split(set, SplitKind::texture, 7, {"6_Blob"}));
  }
}

TEST(Split, NoneTrainsAndTestsOnAll) {
  const WindowSet set = make_set();
  const Split split = make_split(set, SplitKind::none, 1);
  EXPECT_EQ(split.train.size(), set.size());
  EXPECT_EQ(split.test, split.train);
  EXPECT_EQ(count_overlapping(set, split), set.size());
}

TEST(Split, IsAFunctionOfTheSeed) {
  const WindowSet set = make_set();
  for (const SplitKind kind : {SplitKind::window, SplitKind::pass}) {
    const Split a = make_split(set, kind, 1), again = make_split(set, kind, 1), b = make_split(set, kind, 2);
    EXPECT_EQ(a.test, again.test);
    EXPECT_NE(a.test, b.test);
    EXPECT_EQ(fingerprint(a), fingerprint(again));
    EXPECT_NE(fingerprint(a), fingerprint(b));
    EXPECT_TRUE(std::is_sorted(a.train.begin(), a.train.end()));
    EXPECT_TRUE(std::is_sorted(a.test.begin(), a.test.end()));
  }
}

TEST(Split, SaysWhatTheDataLacks) {
  WindowSet set(wide_settings(16));
  set.add(make_recording({.frames = 40}));
  const auto message = [&](SplitKind kind, const std::vector<std::string>& leave_out = {}) {
    return what_of<std::invalid_argument>([&] { make_split(set, kind, 1, leave_out); });
  };
  EXPECT_EQ(message(SplitKind::pass),
            "split pass: passes with windows over 'bumps12' expects two, one to train on, one to test on, "
            "got 1");
  EXPECT_EQ(message(SplitKind::trial),
            "split trial: windows expects one or more to test on, got none; the data needs trials 1 and 2; "
            "split pass or group does without");
  EXPECT_EQ(message(SplitKind::texture),
            "split texture: plates expects two, one to train on, one to test on, got 1");
  EXPECT_EQ(message(SplitKind::texture, {"bumps12"}),
            "split texture: windows expects one or more to train on, got none; the data has nothing unlike "
            "what is left out: train beside random plates, score with split none");
  EXPECT_REFUSAL("split window: windows expects two, one to train on, one to test on, got 0",
                 make_split(WindowSet(wide_settings(16)), SplitKind::window, 1));
  EXPECT_EQ(message(SplitKind::window), "nothing thrown");
}

TEST(Split, WhatIsForTrainingOnlyIsNeverTested) {
  WindowSet set(wide_settings(16));
  for (int trial = 1; trial <= 2; ++trial)
    for (const char* plate : {"ridges6", "bumps6"})
      for (int pass = 1; pass <= 2; ++pass)
        set.add(make_recording({.plate = plate, .trial = trial, .pass = pass, .frames = 30}));
  const std::size_t own = set.size();
  set.add(make_recording({.plate = "ridges6", .trial = 2, .pass = 3, .frames = 30}), ".", kTrainingOnly);
  set.add(make_recording({.plate = "bumps12", .trial = 1, .pass = 1, .frames = 30}), ".", kTrainingOnly);
  ASSERT_EQ(set.size(), own + 30);
  for (const SplitKind kind : {SplitKind::window, SplitKind::pass, SplitKind::trial, SplitKind::none}) {
    const Split split = make_split(set, kind, 3);
    EXPECT_LT(split.test.back(), own) << name_of(kind);
    ASSERT_GT(split.train.size(), 30U) << name_of(kind);
    for (std::size_t i = 0; i < 30; ++i)
      EXPECT_EQ(split.train[split.train.size() - 30 + i], own + i) << name_of(kind);
  }
}

TEST(Split, TakesEvenlySpacedOrAll) {
  const std::vector<std::uint32_t> list{2, 3, 5, 7, 11, 13, 17};
  EXPECT_EQ(evenly_spaced(list, 3), (std::vector<std::uint32_t>{2, 5, 11}));
  EXPECT_EQ(evenly_spaced(list, 7), list);
  EXPECT_EQ(evenly_spaced(list, 100), list);
  EXPECT_TRUE(evenly_spaced({}, 3).empty());
}

TEST(Split, OfSimulatedPassesAFourthOfTheWindowsWithoutContactIsKept) {
  WindowSet windows({.timesteps = 32, .rate_hz = 100, .stride = 8});
  windows.add(simulate_pass(Plate::named("3_Bumps"), {}), ".", kOneOfMany);
  const std::size_t textured = windows.size();
  windows.add(simulate_pass(Plate::named("plain"), {}), ".", kOneOfMany);
  windows.add(simulate_pass(Plate::named("6_Bumps"), {}));
  std::size_t contact = 0, silent = 0, kept_contact = 0, kept_silent = 0, kept_whole = 0;
  for (std::uint32_t i = 0; i < textured; ++i) ++(windows.contact(i) ? contact : silent);
  for (const std::uint32_t i : subsample_no_contact(windows, all_of(windows))) {
    if (i >= textured)
      ++kept_whole;
    else
      ++(windows.contact(i) ? kept_contact : kept_silent);
  }
  EXPECT_GT(contact, 20U);
  EXPECT_EQ(kept_contact, contact);
  EXPECT_EQ(kept_silent, (silent + 3) / 4);
  EXPECT_EQ(kept_whole, windows.size() - textured);
}

TEST(Split, TrialTestsAllTrialsButTheFirst) {
  WindowSet set = make_set();
  set.add(make_recording({.trial = 3, .frames = 40, .level = 2.9F}));
  const Split split = make_split(set, SplitKind::trial, 1);
  for (const std::size_t p : passes_of(set, split.train)) EXPECT_EQ(set.passes()[p].trial, 1);
  for (const std::size_t p : passes_of(set, split.test)) EXPECT_GT(set.passes()[p].trial, 1);
  EXPECT_EQ(split.train.size() + split.test.size(), set.size());
  EXPECT_EQ(count_overlapping(set, split), 0U);
  set.add(make_recording({.trial = 0, .pass = 7, .frames = 30}));
  EXPECT_REFUSAL(
      "split trial: pass 7 over 'bumps12' expects a trial, got none; use split group or pass, or record it "
      "with one",
      make_split(set, SplitKind::trial, 0));
}

TEST(Split, WhatIsForTrainingOnlyIsNoGroupToHoldOut) {
  WindowSet set = set_of_people(3, 3);
  set.add(make_recording({.pass = 4, .frames = 30}), ".", {.training_only = true});
  Split split = make_split(set, SplitKind::group, 3);
  EXPECT_TRUE(hold_out_group(set, split, 3).empty()) << "two groups are left to train on";
}

TEST(Split, GroupKeepsGroupsTogether) {
  WindowSet set = set_of_people(20, 5);
  const Split split = make_split(set, SplitKind::group, 3);
  const auto train = groups_of(set, split.train), test = groups_of(set, split.test);
  EXPECT_EQ(train.size(), 4U);
  EXPECT_EQ(test.size(), 1U);
  EXPECT_FALSE(train.contains(*test.begin()));
  Split left = split;
  const std::vector<std::uint32_t> held_out = hold_out_group(set, left, 3);
  const auto kept = groups_of(set, left.train), taken = groups_of(set, held_out);
  EXPECT_EQ(kept.size(), 3U);
  EXPECT_EQ(taken.size(), 1U);
  EXPECT_FALSE(kept.contains(*taken.begin()));
  EXPECT_EQ(left.train.size() + held_out.size(), split.train.size());
  EXPECT_EQ(left.test, split.test);
  const Split named = make_split(set, SplitKind::group, 3, {"person 2", "person 4"});
  EXPECT_EQ(groups_of(set, named.test), (std::set<std::string>{"person 2", "person 4"}));
  EXPECT_EQ(named.test.size() + named.train.size(), set.size());
  EXPECT_REFUSAL(
      "split group: leave_out expects one of person 0, person 1, person 2, person 3, person 4, got 'person "
      "9'",
      make_split(set, SplitKind::group, 3, {"person 9"}));
  set.add(make_recording({.pass = 21, .frames = 30}));
  EXPECT_REFUSAL(
      "split group: metadata 'group' expects every recording to have it, and two groups, one to train on, "
      "one "
      "to test on, got recordings without: use split pass",
      make_split(set, SplitKind::group, 3));
}

}  // namespace supertac::split_test
