#include "tests/hardware/fault_run.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "data/frames/binary_decoder.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kWorldBegin = 1000;
constexpr double kLongestRun = 3600;

// Whether a damaged move ran, for two faults can cancel in Marlin's 8-bit XOR: one that is neither planned,
// nor a lift, nor a short one in the air by which Palpation measures a printer. What came of it nobody can
// know. That lines run once and in order is MarlinLink's.
bool altered(const std::vector<std::string>& ran, const std::vector<Leg>& legs, const PalpationPlan& plan) {
  const std::string high = " Z" + format(plan.start.z + plan.lift, 3) + " F";
  const auto measured = [&](const std::string& move, double speed) {
    return move.ends_with(high + format(60 * speed, 1));
  };
  return std::ranges::any_of(ran, [&](const std::string& move) {
    return !move.starts_with("G1 Z") && !measured(move, plan.speed) &&
           !measured(move, std::min(2.0, plan.speed / 4)) && std::ranges::none_of(legs, [&](const Leg& leg) {
             return move == move_command(leg.to, leg.speed);
           });
  });
}

// Every frame between the first and the last is received or missing, but for what was lost before the last
// reads: those may be late alone.
std::string check_frames(const Journal& journal, const NumberedBoard& board, const Collection& collection) {
  std::vector<std::uint64_t> numbers;
  BoardDecoder decoder;
  for (const JournalRecord& record : journal.of(JournalStream::board)) {
    decoder.push(record.bytes, [&](const DecodedFrame&) {
      for (const std::uint64_t number :
           board.numbers_in([&](std::size_t k) { return decoder.frame().taxel(static_cast<int>(k)); }))
        numbers.push_back(number);
    });
  }
  if (numbers.empty()) return "no frames";
  const std::uint64_t made = numbers.back() - numbers.front() + 1;
  const std::uint64_t told = collection.clock.dates.size() + collection.clock.missing;
  constexpr std::uint64_t kLastReads = 3;
  if (told <= made && made <= told + kLastReads) return {};
  return "the board made " + std::to_string(made) + " frames, " + std::to_string(told) + " are accounted for";
}

// How fast the head truly went through the middle of a slide, by the frames' numbers; 0: too little is left.
double true_speed(const CollectedPass& pass, const NumberedBoard& board, const PalpationPlan& plan) {
  std::optional<std::uint64_t> first, last;
  for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
    const auto numbers = board.numbers_in(pass.signals, i);
    const double y = pass.position[3 * i + 1] - plan.start.y;
    if (numbers.size() != 1 || y < 0.2 * plan.slide || y > 0.8 * plan.slide) continue;
    if (!first) first = numbers[0];
    last = numbers[0];
  }
  if (!first || *last < *first + 500) return 0;
  return (board.head(*last).y - board.head(*first).y) /
         (rig::kFramePeriodS * static_cast<double>(*last - *first));
}

// No head was ever outside the box of the plan's targets.
std::string check_box(const std::vector<Leg>& legs, const NumberedBoard& board, double more) {
  Point3 low = legs[0].from, high = low;
  for (const Leg& leg : legs) {
    low = {std::min(low.x, leg.to.x), std::min(low.y, leg.to.y), std::min(low.z, leg.to.z)};
    high = {std::max(high.x, leg.to.x), std::max(high.y, leg.to.y), std::max(high.z, leg.to.z)};
  }
  const auto out = [more](double v, double a, double b) { return v < a - more || v > b + more; };
  for (const Point3& p : board.heads())
    if (out(p.x, low.x, high.x) || out(p.y, low.y, high.y) || out(p.z, low.z, high.z))
      return "the head left the plan's box: " + describe(p);
  return {};
}

// Compares every recorded frame with the truth, by its number.
void judge_passes(const Collection& collection, const NumberedBoard& board, const PalpationPlan& plan,
                  FaultVerdict& verdict) {
  for (const CollectedPass& pass : collection.passes) {
    verdict.doubt += pass.doubt + (pass.complete ? "" : "incomplete");
    verdict.left_out += pass.left_out;
    verdict.realtime = pass.positions > 0;
    double worst = 0;
    for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
      const double* p = pass.position.data() + 3 * i;
      const auto numbers = board.numbers_in(pass.signals, i);
      for (const std::uint64_t number : numbers)
        worst = std::max(worst, distance(board.head(number), {p[0], p[1], p[2]}));
      verdict.compared += numbers.empty() ? 0 : 1;
    }
    verdict.worst_mm = std::max(verdict.worst_mm, worst);
    verdict.named_mm_s = named_speed(pass.measured_speed, pass.speed);
    const double true_mm_s = true_speed(pass, board, plan);
    if (!pass.doubt.empty() || !pass.complete) continue;
    if (true_mm_s > 0 && std::abs(verdict.named_mm_s / true_mm_s - 1) > 0.01)
      verdict.broken = "named " + format(verdict.named_mm_s, 2) + " mm/s, truly " + format(true_mm_s, 2);
    verdict.worst_trusted_mm = std::max(verdict.worst_trusted_mm, worst);
    if (worst > kTrustedMm && verdict.broken.empty())
      verdict.broken = "pass " + std::to_string(pass.pass) + " is wrong by " + format(worst, 2) +
                       " mm and does not say so";
  }
}

std::string check_finger(const PalpationOutcome& outcome, SimulatedRig& rig, const Point3& head,
                         double contact_z) {
  using Finger = PalpationOutcome::Finger;
  if (outcome.finger == Finger::unknown) return "the finger was left in contact: " + outcome.note;
  if (outcome.finger == Finger::lifted && head.z < contact_z + 1)
    return "said lifted, is at " + describe(head);
  if (outcome.finger == Finger::stopped && rig.world().printer().moving(rig.now()))
    return "said stopped, still moves";
  return {};
}

// What a firmware has at the end: all but what it is said to keep, where it does, for the answer to what gave
// it back may have been lost; nothing when it restarted before the run.
LeftOver put_back(const RigSettings& rig, const LeftOver& now, const std::string& kept) {
  const VirtualPrinterSettings& printer = rig.printer;
  LeftOver left = printer.left_over;
  if (rig.faults.reset_rate > 0 && now == LeftOver{}) return now;
  const auto either = [&](const char* name, auto member, auto set) {
    if (kept.find(name) != kept.npos && now.*member == set) left.*member = set;
  };
  if (kept.find("speed, flow and coordinates") != kept.npos)
    left = now, left.mesh_mm = printer.left_over.mesh_mm;
  either("mesh compensation", &LeftOver::mesh_mm, now.mesh_mm);
  either("absolute positions", &LeftOver::relative, false);
  either("unit of lengths", &LeftOver::inches, false);
  either("speed factor", &LeftOver::speed_percent, 100.0);
  either("flow factor", &LeftOver::flow_percent, 100.0);
  (printer.firmware == Firmware::klipper ? left.home_offset : left.offset) = {};
  return left;
}

}  // namespace

DrawnRun::DrawnRun(std::uint64_t seed) {
  const bool only_chunks = seed % 10 < 2;
  const RandomStream random(seed, 43);
  std::uint64_t at = 0;
  const auto one_of = [&](std::initializer_list<double> values) {
    return values.begin()[random.bits(at++) % values.size()];
  };
  VirtualPrinterSettings printer;
  printer.firmware = std::array{Firmware::marlin, Firmware::marlin_before_2_1_2, Firmware::klipper}[seed % 3];
  const bool klipper = printer.firmware == Firmware::klipper;
  printer.realtime_position = one_of({0, 1, 1, 1}) > 0;
  rig.chunk_s = one_of({0, 0.002, 0.01, 0.03, 0.1});
  RigFaults faults;
  if (!only_chunks) {
    const double byte_rate = one_of({0, 0.0002, 0.001, 0.002});
    faults = {.byte_rate = byte_rate,
              .reset_rate = one_of({0, 0, 0, 0.0005}),
              .action_rate = one_of({0, 0, 0, 0.0005}),
              .pause_rate = klipper ? 0 : one_of({0, 0, 0, 0.0005}),
              .freeze_rate = one_of({0, 0, 0.0003}),
              .host_freeze_rate = one_of({0, 0.0003, 0.001})};
    // While the host stands still it cannot stop what a damaged line of Klipper's began.
    if (klipper && byte_rate > 0) faults.host_freeze_rate = 0;
    LeftOver& left = printer.left_over;
    left.relative = one_of({0, 0, 1}) > 0;
    left.speed_percent = one_of({100, 100, 50, 150, 300});
    left.flow_percent = one_of({100, 80});
    if (!klipper) left.inches = one_of({0, 0, 1}) > 0;
    left.mesh_mm = one_of({0, 0, 0.46});
    if (klipper) left.offset = {0, 0, one_of({0, -0.35, 1.2})};
    printer.acceleration = one_of({200, 500, 500, 3000});
    printer.slowness = one_of({1, 1, 1, 1, 0.7, 1.4});
    plan.speed = one_of({5, 10, 10, 25});
  }
  rig.printer = printer;
  rig.printer_running = true;
  rig.faults = faults;
  rig.seed = seed;
}

FaultVerdict run_faulty_collection(const RigSettings& rig_settings, const PalpationPlan& plan,
                                   const Point3& origin, const PortBetween& printer) {
  FaultVerdict verdict;
  NumberedCollection collected(rig_settings, plan, origin);
  auto& [board, bench] = collected;
  SimulatedRig& rig = bench.rig;
  std::vector<std::string> numbered;
  rig.world().printer().on_line([&](std::int64_t, const std::string& command, double) {
    if (command.starts_with("G1 ")) numbered.push_back(command);
  });
  bench.settings.reader.silence_s = 5;
  const std::vector<Leg> legs = legs_within(bench.settings.bed.limits, plan, origin);
  try {
    auto port = rig.printer_port();
    if (printer) port = printer(std::move(port));
    const RecorderReport report = record_palpation(rig.board_port(), std::move(port), bench.settings);
    const Point3 head = bench.head();
    verdict.complete = report.outcome.complete;
    // Klipper runs damaged lines as well: what they did is seen by where the head was. A line break behind a
    // line's number makes Marlin run it without one, and again.
    const bool klippers = rig_settings.printer.firmware == Firmware::klipper;
    const bool damaged =
        (!(klippers && rig_settings.faults.byte_rate > 0) && altered(numbered, legs, plan)) ||
        moves_of(rig.world().printer()).size() > numbered.size();
    if (verdict.complete && distance(head, legs.back().to) > 0.05) {
      verdict.broken = "false done: the head is at " + describe(head);
    }
    if (!verdict.complete && verdict.broken.empty()) {
      verdict.broken = check_finger(report.outcome, rig, head, plan.start.z);
    }
    const Journal journal = bench.journal();
    const Collection collection = collection_of(journal);
    verdict.missing = collection.clock.missing;
    judge_passes(collection, board, plan, verdict);
    if (!damaged && verdict.broken.empty())
      verdict.broken = check_box(legs, board, 0.1 + std::abs(rig_settings.printer.left_over.mesh_mm));
    rig.run_for(3);  // a firmware that stands still has taken lines that it will run
    if (verdict.complete && !damaged && verdict.broken.empty() &&
        bench.firmware().left_over() != put_back(rig_settings, bench.firmware().left_over(), report.kept))
      verdict.broken = "what was changed in the printer was not put back";
    // Nobody can count frames to one that waited among lost ones.
    const RigFaults& faults = rig_settings.faults;
    const bool countable =
        rig_settings.chunk_s == 0 && faults.host_freeze_rate == 0 && faults.freeze_rate == 0;
    if (verdict.broken.empty() && countable) verdict.broken = check_frames(journal, board, collection);
    if (report.outcome.error) std::rethrow_exception(report.outcome.error);
  } catch (const HardwareError& error) {
    verdict.error = error.what();
  } catch (const std::exception& error) {
    verdict.broken = std::string("untyped error: ") + error.what();
  }
  if (verdict.broken.empty() && rig.now() - kWorldBegin > kLongestRun) verdict.broken = "took too long";
  return verdict;
}

}  // namespace supertac
