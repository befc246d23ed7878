#include "data/registration/alignment.h"

#include <stdexcept>
#include <vector>

#include "data/registration/profile.h"
#include "io/numbers/median.h"
#include "io/numbers/parallel.h"

namespace supertac {
namespace {

constexpr double kMiddleMm = 54, kHalfMm = 26;
constexpr double kPenalty = 0.002, kUsualShiftMm = 0.5, kUsualStretchMm = 1;
constexpr double kFirstStepMm = 0.4, kLastStepMm = 0.01;
constexpr int kRounds = 6;
constexpr std::size_t kFewestPasses = 3;
constexpr double kLeastAgreement = 0.5;
// A loss is sought where passes disagree, and believed when they agree so much better with it.
constexpr double kDisagreement = 0.9, kGain = 0.05;
constexpr double kLossEveryS = 0.2, kLossStepS = 0.1, kLongestLossS = 0.8;

struct Change {
  double shift_mm = 0, stretch_mm = 0;
};

struct Loss {
  double at_s = 0, seconds = 0;
};

// y' = y + a + b (y - 54) / 26 of y = start + rate t is a line again.
Registration changed(Registration r, const Change& change) {
  const double stretch = change.stretch_mm / kHalfMm;
  r.start_mm += change.shift_mm + stretch * (r.start_mm - kMiddleMm);
  r.rate *= 1 + stretch;
  return r;
}

struct Found {
  Change change;
  Loss loss;
  double agreement = -1;
};

// Pattern search (Hooke & Jeeves 1961): steps along a and b, halved when none is better.
Found best_change(const PassSignals& signals, const Registration& registration, const Profile& others,
                  const Change& start) {
  const auto score = [&](const Change& c, double& agreement) {
    agreement = correlation(signals.along(changed(registration, c)), others);
    const double shift = c.shift_mm / kUsualShiftMm, stretch = c.stretch_mm / kUsualStretchMm;
    return agreement - kPenalty * (shift * shift + stretch * stretch);
  };
  Found best;
  best.change = start;
  double highest = score(start, best.agreement);
  for (double step = kFirstStepMm; step >= kLastStepMm;) {
    bool better = false;
    for (const Change& move : {Change{step, 0}, Change{-step, 0}, Change{0, step}, Change{0, -step}}) {
      Found tried;
      tried.change = {best.change.shift_mm + move.shift_mm, best.change.stretch_mm + move.stretch_mm};
      const double value = score(tried.change, tried.agreement);
      if (value > highest) highest = value, best = tried, better = true;
    }
    if (!better) step /= 2;
  }
  return best;
}

// The line was fitted to contacts of both parts of the pass: it is about right in the longer one.
Registration before_loss(Registration registration, const Loss& loss) {
  const double middle_s = (registration.valid_from_s + registration.valid_until_s) / 2;
  if (loss.at_s < middle_s) registration.start_mm -= registration.rate * loss.seconds;
  return registration;
}

// The one loss of frames with which the pass agrees best with the others, if by much.
Found with_loss(const PassSignals& signals, const Registration& registration, const Profile& others,
                const Found& without) {
  Found best = without;
  const std::vector<double>& time = signals.time_s();
  for (double at = time.front() + kLossEveryS; at < time.back(); at += kLossEveryS) {
    for (double seconds = kLossStepS; seconds <= kLongestLossS; seconds += kLossStepS) {
      const Loss loss{.at_s = at, .seconds = seconds};
      Found tried = best_change(signals.delayed(loss.at_s, loss.seconds), before_loss(registration, loss),
                                others, without.change);
      tried.loss = loss;
      if (tried.agreement > best.agreement) best = tried;
    }
  }
  return best.agreement > without.agreement + kGain ? best : without;
}

struct Aligned {
  Registration* result;
  Registration registration;
  PassSignals signals;
  Found found;

  Profile profile() const { return signals.along(changed(registration, found.change)); }
};

std::vector<Profile> profiles_of(const std::vector<Aligned>& passes) {
  std::vector<Profile> profiles;
  for (const Aligned& pass : passes) profiles.push_back(pass.profile());
  return profiles;
}

void take_medians_off(std::vector<Aligned>& passes) {
  std::vector<double> shifts, stretches;
  for (const Aligned& pass : passes) {
    shifts.push_back(pass.found.change.shift_mm);
    stretches.push_back(pass.found.change.stretch_mm);
  }
  const double shift = median(shifts), stretch = median(stretches);
  for (Aligned& pass : passes) pass.found.change.shift_mm -= shift, pass.found.change.stretch_mm -= stretch;
}

void align(std::vector<Aligned>& passes) {
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Profile> profiles = profiles_of(passes);
    parallel_for(passes.size(), [&](std::size_t i) {
      Aligned& pass = passes[i];
      const Loss loss = pass.found.loss;
      pass.found =
          best_change(pass.signals, pass.registration, mean_of_others(profiles, i), pass.found.change);
      pass.found.loss = loss;
    });
    take_medians_off(passes);
  }
}

bool find_losses(std::vector<Aligned>& passes) {
  const std::vector<Profile> profiles = profiles_of(passes);
  bool any = false;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    Aligned& pass = passes[i];
    if (pass.found.agreement > kDisagreement || pass.found.agreement < kLeastAgreement) continue;
    pass.found = with_loss(pass.signals, pass.registration, mean_of_others(profiles, i), pass.found);
    if (pass.found.loss.seconds == 0) continue;
    pass.signals = pass.signals.delayed(pass.found.loss.at_s, pass.found.loss.seconds);
    pass.registration = before_loss(pass.registration, pass.found.loss);
    any = true;
  }
  return any;
}

}  // namespace

void align_passes(std::span<const RegisteredPass> passes) {
  std::vector<Aligned> reliable;
  for (const RegisteredPass& pass : passes) {
    if (!pass.registration->reliable) continue;
    if (pass.recording->array != TaxelArray{})
      throw std::invalid_argument("align_passes: expected recordings of the rig's " + TaxelArray{}.text() +
                                  ", got " + pass.recording->array.text());
    reliable.push_back(
        {pass.registration, *pass.registration, PassSignals(*pass.recording, *pass.registration), {}});
  }
  if (reliable.size() < kFewestPasses) return;
  align(reliable);
  if (find_losses(reliable)) align(reliable);
  for (const auto& [result, registration, signals, found] : reliable) {
    if (found.agreement < kLeastAgreement) continue;
    *result = changed(registration, found.change);
    result->shift_mm = found.change.shift_mm;
    result->stretch_mm = found.change.stretch_mm;
    result->lost_at_s = found.loss.at_s;
    result->lost_s = found.loss.seconds;
    result->agreement = found.agreement;
  }
}

}  // namespace supertac
