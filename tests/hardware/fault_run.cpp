#include "fault_run.h"

#include <cmath>

#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"
#include "rig_support.h"

namespace supertac {
namespace {

constexpr double kWorldBegin = 1000;
constexpr double kLongestRun = 3600;

std::vector<std::string> planned_moves(const PalpationPlan& plan, const Point3& origin) {
  std::vector<std::string> moves;
  for (const Leg& leg : legs_of(plan, origin)) {
    moves.push_back("G1 X" + format(leg.to.x, 3) + " Y" + format(leg.to.y, 3) + " Z" + format(leg.to.z, 3) +
                    " F" + format(60 * leg.speed, 1));
  }
  return moves;
}

// Moves run once and in order; after a fault one lift (G1 Z...) may follow. Two faults can cancel in the XOR:
// such a move is noted, and what came of it is judged by where the head is.
std::string check_moves(const std::vector<std::string>& ran, const std::vector<std::string>& planned,
                        FaultVerdict& verdict) {
  std::size_t count = ran.size();
  if (!verdict.complete && count > 0 && ran.back().starts_with("G1 Z")) --count;
  if (count > planned.size() || (verdict.complete && count != planned.size())) {
    return "ran " + std::to_string(count) + " moves, planned " + std::to_string(planned.size());
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (ran[i] == planned[i]) continue;
    if (i > 0 && ran[i] == planned[i - 1]) return "move " + std::to_string(i) + " ran twice: " + ran[i];
    verdict.altered = ran[i] + ", planned " + planned[i];
  }
  return {};
}

// Frame number of an arrival: it is at most a fifth of a period late.
std::int64_t frame_of(double arrival) {
  return std::llround(std::floor((arrival - kWorldBegin) / rig::kFramePeriodS)) - 1;
}

std::string check_frames(const Journal& journal, FaultVerdict& verdict) {
  std::vector<double> arrivals;
  FrameDecoder decoder;
  for (const JournalRecord& record : journal.of(Stream::board)) {
    decoder.push(record.bytes, [&](const BoardFrame&, std::uint64_t) { arrivals.push_back(record.time_s); });
  }
  if (arrivals.empty()) return "no frames";
  const FrameTimeline timeline = timeline_of(arrivals);
  verdict.frames = arrivals.size();
  verdict.missing = timeline.missing;
  const std::int64_t made = frame_of(arrivals.back()) - frame_of(arrivals.front()) + 1;
  const auto told = static_cast<std::int64_t>(verdict.frames + verdict.missing);
  if (made == told) return {};
  return "the board made " + std::to_string(made) + " frames, " + std::to_string(told) + " are accounted for";
}

std::string check_finger(const PalpationOutcome& outcome, SimulatedRig& rig, const Point3& head,
                         double contact_z) {
  using Finger = PalpationOutcome::Finger;
  const bool reachable = !rig.world().printer().unplugged();
  if (outcome.finger == Finger::unknown && reachable)
    return "the finger was left in contact: " + outcome.note;
  if (outcome.finger == Finger::lifted && head.z < contact_z + 1)
    return "said lifted, is at " + describe(head);
  if (outcome.finger == Finger::stopped && rig.world().printer().moving(rig.now()))
    return "said stopped, still moves";
  return {};
}

}  // namespace

FaultVerdict run_faulty_collection(const RigFaults& faults, std::uint64_t seed, int passes) {
  FaultVerdict verdict;
  const TemporaryFolder folder;
  RigSettings rig_settings = running_rig();
  rig_settings.faults = faults;
  rig_settings.seed = seed;
  SimulatedRig rig(rig_settings);
  RecorderSettings settings;
  settings.plan.passes = passes;
  settings.journal = folder / "journal";
  settings.header = "fault run";
  const std::vector<std::string> planned = planned_moves(settings.plan, settings.origin);
  const std::vector<Leg> legs = legs_of(settings.plan, settings.origin);
  try {
    const RecorderReport report = record_palpation(rig.board_port(), rig.printer_port(), settings);
    const Point3 head = rig.world().printer().head(rig.now());
    verdict.complete = report.outcome.complete;
    verdict.printer = report.printer;
    verdict.broken = check_moves(moves_of(rig.world().printer()), planned, verdict);
    if (verdict.complete && distance(head, legs.back().to) > 0.05) {
      verdict.broken = "false done: the head is at " + describe(head);
    }
    if (!verdict.complete && verdict.broken.empty()) {
      verdict.broken = check_finger(report.outcome, rig, head, settings.plan.start.z);
    }
    if (verdict.broken.empty()) verdict.broken = check_frames(read_journal(settings.journal), verdict);
    if (report.outcome.error) std::rethrow_exception(report.outcome.error);
  } catch (const HardwareError& error) {
    verdict.error = error.what();
  } catch (const std::exception& error) {
    verdict.broken = std::string("untyped error: ") + error.what();
  }
  verdict.simulated_s = rig.now() - kWorldBegin;
  if (verdict.broken.empty() && verdict.simulated_s > kLongestRun) verdict.broken = "took too long";
  return verdict;
}

}  // namespace supertac
