#include "data/registration/registration.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/numbers/numbers.h"
#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

// The first element under the leading row and the last one under the trailing row carry the finger alone and
// are felt further out, with slopes of different steepness: little weight.
constexpr double kAloneShiftMm = 1.0, kAloneWeight = 0.2;

constexpr double kFullDepthV = 0.1;  // deeper contacts weigh no more: they saturate
constexpr double kScanReachMm = 1.2, kFitReachMm = 1.5;
constexpr double kMiddleReachMm = 45, kMiddleStepMm = 0.25;
constexpr double kSlowest = 0.6, kFastest = 2.2, kRateStep = 0.01;

// When a pass is believed.
constexpr int kMinContacts = 8, kMinElements = 3;
// A clock that counts lines runs slow by the frames that were lost and not seen: by a few per cent, and by up
// to twice the share that was seen. It never runs fast: the board sends no more frames than it measures.
constexpr double kSlowestClock = 0.97, kUnseenLoss = 0.05, kUnseenPerSeen = 2, kTimedClock = 0.05;
constexpr double kMinMatched = 0.4, kMinCoverage = 0.3, kMaxResidualMm = 0.55, kMinMargin = 0.03;

struct Event {
  std::size_t row = 0;
  double time = 0, weight = 0;
};

struct Line {
  double middle_mm = 0, rate = 0;  // y at the middle of the recording, mm/s
  double matched = 0, coverage = 0, score = -std::numeric_limits<double>::infinity();
};

struct Match {
  std::size_t crest = 0;
  double distance_mm = 0;  // crest minus contact
  double weight = 0;
};

// The least distance of neighbouring crests, `most` where none is less.
double least_pitch(const std::vector<double>& crests, double most) {
  for (std::size_t j = 1; j < crests.size(); ++j) most = std::min(most, crests[j] - crests[j - 1]);
  return most;
}

// Where, from the centre along y, a row of taxels (0 trailing) feels an element best. The rig's rows do so
// nearer together than they lie, for its pad is round; those of another sensor, of the same array too, where
// they are.
double row_contact_mm(const Recording& recording, std::size_t row) {
  constexpr double kRigMm[] = {-3.5, -1.3, 1.3, 3.5};  // medians over the rig's 96 passes
  const TaxelArray& array = recording.array;
  const bool of_the_rig = array == TaxelArray{} && recording.signal_scale == SignalScale{};
  return of_the_rig ? kRigMm[row] : array.y_mm(static_cast<int>(row) * array.columns);
}

class Fit {
 public:
  Fit(const Recording& recording, const Plate& plate)
      : crests_(plate.crests()),
        troughs_(plate.min_height() < 0),
        speed_(recording.speed_mm_s > 0 ? recording.speed_mm_s : rig::kSlideMmS),
        middle_s_((recording.time_s.front() + recording.time_s.back()) / 2) {
    for (int row = 0; row < recording.array.rows; ++row)
      row_mm_.push_back(row_contact_mm(recording, static_cast<std::size_t>(row)));
    const std::vector<Contact> contacts = find_contacts(recording, 0.6 * pitch() / speed_);
    double most = 0;
    for (const Stretch& stretch : stretches_of(recording)) {
      double weight = 0;
      for (const Contact& c : contacts) weight += inside(c, stretch) ? weight_of(c) : 0.0;
      if (weight > most) most = weight, stretch_ = stretch;
    }
    for (const Contact& c : contacts)
      if (inside(c, stretch_))
        events_.push_back({.row = static_cast<std::size_t>(c.taxel / recording.array.columns),
                           .time = c.time_s - middle_s_,
                           .weight = weight_of(c)});
    // A recording that goes on long after the pass, or begins long before it, has its middle beside the
    // plate.
    if (events_.empty()) return;
    const auto [first, last] = std::ranges::minmax(events_, {}, &Event::time);
    if (first.time <= 0 && last.time >= 0) return;
    const double shift = (first.time + last.time) / 2;
    middle_s_ += shift;
    for (Event& event : events_) event.time -= shift;
  }

  bool felt_nothing() const { return events_.empty(); }

  // Of all starts and rates the best, refined; its margin is that before the best which means another place
  // or another pitch.
  Registration best(double filter_s) const {
    std::vector<Line> lines;
    for (double factor = kSlowest; factor < kFastest; factor *= 1 + kRateStep)
      for (double offset = -kMiddleReachMm; offset <= kMiddleReachMm; offset += kMiddleStepMm)
        lines.push_back(scored(rig::kPlateLengthMm / 2 + offset, speed_ * factor));
    Line best = *std::ranges::max_element(lines, {}, &Line::score), rival;
    for (const Line& line : lines)
      if (elsewhere(line, best) && line.score > rival.score) rival = line;
    const double margin = best.score - rival.score;
    refine(best);
    double w = 0, wdd = 0;
    std::vector<bool> felt(crests_.size());
    Registration r{.rate = best.rate,
                   .matched = best.matched,
                   .coverage = best.coverage,
                   .margin = margin,
                   .valid_from_s = stretch_.begin_s,
                   .valid_until_s = stretch_.end_s};
    for (const Event& event : events_) {
      const Match m = match(event, best);
      if (m.weight > 0) felt[m.crest] = true, ++r.contacts;
      w += m.weight, wdd += m.weight * m.distance_mm * m.distance_mm;
    }
    r.residual = w > 0 ? std::sqrt(wdd / w) : 0;
    r.elements = static_cast<int>(std::ranges::count(felt, true));
    // Signals trail the finger: where a contact shows at t, the finger has been since t - delay.
    r.start_mm = best.middle_mm - best.rate * middle_s_ + speed_ * filter_s / 2;
    return r;
  }

 private:
  // Weighted least squares with Tukey's biweight, repeated until the weights have settled.
  void refine(Line& line) const {
    for (int repeat = 0; repeat < 20; ++repeat) {
      double w = 0, wt = 0, wtt = 0, wd = 0, wtd = 0;
      for (const Event& event : events_) {
        const Match m = match(event, line);
        w += m.weight, wt += m.weight * event.time, wtt += m.weight * event.time * event.time;
        wd += m.weight * m.distance_mm, wtd += m.weight * m.distance_mm * event.time;
      }
      const double determinant = w * wtt - wt * wt;
      if (!(determinant > 1e-9)) return;
      line.middle_mm += (wtt * wd - wt * wtd) / determinant;
      line.rate += (w * wtd - wt * wd) / determinant;
    }
    line = scored(line.middle_mm, line.rate);
  }

  Match match(const Event& event, const Line& line) const {
    const double y = line.middle_mm + line.rate * event.time + row_mm_[event.row];
    const std::size_t nearest = nearest_crest(y);
    Match m{.crest = nearest, .distance_mm = crests_[nearest] - y, .weight = event.weight};
    const bool leading_alone = event.row + 1 == row_mm_.size() && nearest == 0;
    const bool trailing_alone = event.row == 0 && nearest + 1 == crests_.size();
    if (leading_alone) m.distance_mm -= kAloneShiftMm;
    if (trailing_alone) m.distance_mm += kAloneShiftMm;
    // The outermost crests of waves are lopsided: a trough inside, the flat plate outside.
    const bool lopsided = troughs_ && (nearest == 0 || nearest + 1 == crests_.size());
    if (leading_alone || trailing_alone || lopsided) m.weight *= kAloneWeight;
    const double u = m.distance_mm / kFitReachMm;
    m.weight *= std::abs(u) < 1 ? (1 - u * u) * (1 - u * u) : 0.0;
    return m;
  }

  double pitch() const { return least_pitch(crests_, 12); }

  std::size_t nearest_crest(double y) const {
    const auto away = [y](double crest) { return std::abs(crest - y); };
    return static_cast<std::size_t>(std::ranges::min_element(crests_, {}, away) - crests_.begin());
  }

  static bool inside(const Contact& c, const Stretch& s) {
    return c.time_s >= s.begin_s && c.time_s <= s.end_s;
  }

  static double weight_of(const Contact& c) { return std::sqrt(std::min(c.depth_v / kFullDepthV, 1.0)); }

  // A pass covers the plate about evenly and its clock is about right: mild preference, in units of the
  // score.
  double preference(double middle_mm, double rate) const {
    const double off = (middle_mm - rig::kPlateLengthMm / 2) / 10,
                 fast = same_bits::log(rate / speed_) / 0.15;
    return -0.05 * (off * off + fast * fast);
  }

  bool elsewhere(const Line& a, const Line& b) const {
    return std::abs(a.middle_mm - b.middle_mm) > pitch() / 2 ||
           std::abs(same_bits::log(a.rate / b.rate)) > 0.25;
  }

  Line scored(double middle_mm, double rate) const {
    Line line{.middle_mm = middle_mm, .rate = rate};
    std::vector<double> felt(crests_.size() * row_mm_.size());  // [element][row]
    double total = 0, agree = 0;
    for (const Event& event : events_) {
      const double y = middle_mm + rate * event.time + row_mm_[event.row];
      const std::size_t nearest = nearest_crest(y);
      const double fit = std::max(0.0, 1 - std::abs(crests_[nearest] - y) / kScanReachMm);
      total += event.weight, agree += event.weight * fit;
      double& best = felt[nearest * row_mm_.size() + event.row];
      best = std::max(best, fit);
    }
    line.matched = total > 0 ? agree / total : 0;
    // Of the (element, row) pairs the stretch reached: share felt, and share of elements felt by a row.
    double pairs = 0, felt_pairs = 0, reached = 0, felt_elements = 0;
    for (std::size_t j = 0; j < crests_.size(); ++j) {
      double best = -1;
      for (std::size_t row = 0; row < row_mm_.size(); ++row) {
        const double time = (crests_[j] - row_mm_[row] - middle_mm) / rate + middle_s_;
        if (time < stretch_.begin_s || time > stretch_.end_s) continue;
        pairs += 1, felt_pairs += felt[j * row_mm_.size() + row];
        best = std::max(best, felt[j * row_mm_.size() + row]);
      }
      if (best >= 0) reached += 1, felt_elements += best;
    }
    line.coverage = pairs > 0 ? felt_pairs / pairs : 0;
    const double elements = reached > 0 ? felt_elements / reached : 0;
    line.score = line.matched + line.coverage + elements + preference(middle_mm, rate);
    return line;
  }

  std::vector<double> crests_, row_mm_;
  bool troughs_;
  Stretch stretch_;
  double speed_, middle_s_;
  std::vector<Event> events_;
};

std::string why_unreliable(const Registration& r) {
  if (r.contacts < kMinContacts)
    return "only " + std::to_string(r.contacts) + " contacts, need " + std::to_string(kMinContacts);
  if (r.elements < kMinElements)
    return "only " + std::to_string(r.elements) + " elements of the texture, need " +
           std::to_string(kMinElements);
  if (r.matched < kMinMatched)
    return "only " + format(100 * r.matched, 0) + " % of the contacts agree with the plate";
  if (r.coverage < kMinCoverage)
    return "only " + format(100 * r.coverage, 0) + " % of the plate's elements were felt";
  if (r.residual > kMaxResidualMm) return "contacts lie " + format(r.residual, 2) + " mm (rms) off the plate";
  if (r.margin < kMinMargin) return "another start fits as well (off by a pitch?)";
  return "";
}

// The speed that is stated against the one that was fitted, and both against what the signals can show.
std::string why_implausible(const Registration& r, const Recording& recording, const Plate& plate) {
  const double speed = recording.speed_mm_s > 0 ? recording.speed_mm_s : rig::kSlideMmS;
  const bool counted = value_or(recording.metadata, "time_base") == "nominal";
  const double lost = parse_double(value_or(recording.metadata, "lost_frames")).value_or(0);
  const double seen = recording.frames() > 0 ? lost / static_cast<double>(recording.frames()) : 0;
  const double clock = r.rate / speed;  // true seconds in one of the recording's
  const std::string both =
      "the signals show " + format(r.rate, 1) + " mm/s, the stated speed is " + format(speed, 1) + " mm/s";
  if (clock < (counted ? kSlowestClock : 1 - kTimedClock))
    return both + (counted ? ": the board would have sent " + format(rig::kFrameRateHz / clock, 0) +
                                 " frames a second, it sends " + format(rig::kFrameRateHz, 0)
                           : "");
  if (clock > 1 + (counted ? kUnseenLoss + kUnseenPerSeen * seen : kTimedClock))
    return both + (counted ? ": more frames would be missing than can be (" + format(100 * seen, 0) +
                                 " % were seen to be lost)"
                           : "");
  const double texture = plate.texture_end() - plate.texture_begin();
  const double gone = (lost / rig::kFrameRateHz + r.lost_s) * speed;
  if (gone > texture)
    return "frames of " + format(gone, 0) + " mm were lost, the texture is " + format(texture, 0) +
           " mm long";
  const double pitch = least_pitch(plate.crests(), texture);
  // Beyond half a pitch the first and last elements may vanish, and what is left fits a pitch further as
  // well.
  if (recording.filter_s() * speed > 0.5 * pitch)
    return "the board's filter averages over " + format(recording.filter_s() * speed, 1) +
           " mm, the elements lie " + format(pitch, 1) + " mm apart; slide slower";
  return "";
}

// Frames lost where nothing moved: a straight line from the signals before to those behind. Where the finger
// was in each of them is left open.
void fill_loss(const Registration& registration, Recording& recording) {
  std::vector<double>& time = recording.time_s;
  const auto found = std::lower_bound(time.begin(), time.end(), registration.lost_at_s);
  const auto at = static_cast<std::size_t>(found - time.begin());
  for (std::size_t i = at; i < time.size(); ++i) time[i] += registration.lost_s;
  if (at < 2 || at == time.size()) return;  // nothing on one side
  const std::size_t signals = recording.array.signals();
  const double step = (time[at - 1] - time[0]) / static_cast<double>(at - 1), gap = time[at] - time[at - 1];
  const auto lost = static_cast<std::size_t>(std::max(0.0, gap / step - 1));
  const auto open = [lost](auto& values, std::size_t before, std::size_t each, auto value) {
    values.insert(values.begin() + static_cast<std::ptrdiff_t>(before * each), lost * each, value);
  };
  const double last_s = time[at - 1];
  const float x_mm = recording.position_mm[0];
  open(time, at, 1, 0.0), open(recording.signals, at, signals, 0.0F);
  open(recording.position_mm, at, 2, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t k = 0; k < lost; ++k) {
    const double part = static_cast<double>(k + 1) / static_cast<double>(lost + 1);
    time[at + k] = last_s + part * gap;
    recording.position_mm[2 * (at + k)] = x_mm;
    for (std::size_t s = 0; s < signals; ++s)
      recording.signals[(at + k) * signals + s] =
          std::lerp(recording.signals[(at - 1) * signals + s], recording.signals[(at + lost) * signals + s],
                    static_cast<float>(part));
  }
}

}  // namespace

void judge(Registration& r, const Recording& recording, const Plate& plate) {
  r.reason = why_unreliable(r);
  if (r.reason.empty()) r.reason = why_implausible(r, recording, plate);
  r.reliable = r.reason.empty();
}

Registration register_pass(const Recording& recording, const Plate& plate) {
  Registration result;
  const auto flagged = [&](const std::string& reason) {
    result.reason = reason;
    return result;
  };
  if (plate.crests().empty()) return flagged("a plain plate has nothing to register against");
  if (recording.frames() < 3) return flagged("the recording is empty");
  const Fit fit(recording, plate);
  if (fit.felt_nothing()) return flagged("no taxel felt anything");
  result = fit.best(recording.filter_s());
  judge(result, recording, plate);
  return result;
}

void apply(const Registration& registration, Recording& recording, double x_mm) {
  const bool nominal = value_or(recording.metadata, "time_base") == "nominal";
  const std::size_t n = recording.frames();
  recording.position_mm.resize(2 * n);
  const auto x = static_cast<float>(x_mm);
  for (std::size_t i = 0; i < n; ++i) {
    const double y = registration.y_mm(recording.time_s[i]);
    const bool known =
        recording.time_s[i] >= registration.valid_from_s && recording.time_s[i] <= registration.valid_until_s;
    recording.position_mm[2 * i] = x;
    recording.position_mm[2 * i + 1] = known ? static_cast<float>(std::clamp(y, 0.0, rig::kPlateLengthMm))
                                             : std::numeric_limits<float>::quiet_NaN();
  }
  if (registration.lost_s > 0) fill_loss(registration, recording);
  if (nominal && registration.reliable) {  // the finger's speed is known better than the rate of the lines
    const double speed = recording.speed_mm_s > 0 ? recording.speed_mm_s : rig::kSlideMmS;
    for (double& t : recording.time_s) t *= registration.rate / speed;
    recording.metadata["time_base"] = "registered";
  }
  recording.metadata["registration_start_mm"] = format(registration.start_mm, 3);
  recording.metadata["registration_rate"] = format(registration.rate, 4);
  recording.metadata["registration_residual_mm"] = format(registration.residual, 3);
  recording.metadata["registration_reliable"] = registration.reliable ? "yes" : "no";
  recording.metadata["registration_reason"] = registration.reason;
  recording.metadata["registration_shift_mm"] = format(registration.shift_mm, 3);
  recording.metadata["registration_stretch_mm"] = format(registration.stretch_mm, 3);
  recording.metadata["registration_lost_s"] = format(registration.lost_s, 3);
}

}  // namespace supertac
