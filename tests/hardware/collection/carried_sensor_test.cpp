// Collections with another sensor than the rig's board, on another bed: a text sensor of 100 Hz rides on the
// simulated rig's head, and every frame carries its number.

#include "data/frames/binary_decoder.h"
#include "hardware/collection/collection.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::carried_sensor_test {

constexpr int kEvery = 10;  // board frames a frame of the sensor

Sensor mat(bool stamped) {
  Sensor sensor;
  sensor.name = "mat";
  sensor.array = {.rows = 8, .columns = 8, .pitch_mm = 2};
  sensor.scale = {.unit = "counts", .rest = 40, .span = -860};
  sensor.rate_hz = 100;
  sensor.frame.kind = FrameKind::text;
  if (stamped) sensor.frame.time = FrameTime{.column = 0, .unit_s = 1e-3};
  for (int k = 0; k < 64; ++k) sensor.order.push_back(k % 8 * 8 + k / 8);  // column-major
  sensor.dead = {9};
  return sensor;
}

/// Frame n of the board, of every ten, as a line of `sensor`: sent half a period later, by a clock that is
/// fast by three thousandths.
class TextPort : public WrappedPort {
 public:
  TextPort(std::unique_ptr<Port> board, const NumberedBoard& numbers, Sensor sensor)
      : WrappedPort(std::move(board)), numbers_(numbers), sensor_(std::move(sensor)) {}
  Received read(std::span<std::byte> buffer, double until) override {
    // What waited while the host stood still: a terminal hands it on at once.
    constexpr double kAtOnceS = 4e-4;
    for (bool more = said_.empty(); more;) {
      if (next_.count == 0) next_ = inner_->read(raw_, until);
      if (next_.count == 0 && said_.empty()) return next_;
      more = next_.count > 0 && (said_.empty() || next_.time_s - now_ < kAtOnceS);
      if (!more) break;
      now_ = next_.time_s;
      decoder_.push(std::span(raw_).first(std::exchange(next_.count, 0)),
                    [this](const DecodedFrame&) { take(decoder_.frame()); });
      if (!said_.empty()) until = now_;
    }
    return hand_on(buffer);
  }

 private:
  void take(const BoardFrame& frame) {
    const auto numbers = numbers_.numbers_in([&](std::size_t k) { return frame.taxel(static_cast<int>(k)); });
    if (numbers.empty() || numbers[0] / kEvery == sent_) return;
    sent_ = numbers[0] / kEvery;
    const std::uint64_t number = sent_ * kEvery - kEvery / 2;
    std::vector<double> values(64, 100);
    values[0] = static_cast<double>(number % 1000), values[1] = static_cast<double>(number / 1000);
    said_ += sent_frame(sensor_, values, 1.003 * static_cast<double>(sent_) * kEvery * rig::kFramePeriodS);
  }

  const NumberedBoard& numbers_;
  Sensor sensor_;
  BoardDecoder decoder_;
  std::array<std::byte, 8192> raw_{};
  Received next_;  // read, and not yet handed on
  std::uint64_t sent_ = 0;
};

std::string header_of(const Sensor& sensor, const Bed& bed) {
  return nlohmann::ordered_json{{"version", 1}, {"sensor", json_of(sensor)}, {"bed", json_of(bed)}}.dump();
}

/// Half a metre from where the rig has it, for one slide of 60 mm.
Bed far_bed() {
  Bed bed;
  bed.limits = {.low = {400, 400, 0}, .high = {700, 700, 300}, .plate = {500, 510, 20}};
  bed.origin = {505, 500, 40};
  bed.plan.start = {505, 510, 20};
  bed.plan.passes = 1, bed.plan.slide = 60;
  return bed;
}

struct CarriedSensor : NumberedCollection {
  explicit CarriedSensor(const Sensor& sensor, const RigSettings& rig = running_rig())
      : NumberedCollection(rig, far_bed().plan, far_bed().origin) {
    bench.settings.bed = far_bed();
    bench.settings.sensor = sensor;
    bench.settings.header = header_of(sensor, far_bed());
  }
  RecorderReport record() {
    return record_palpation(
        std::make_unique<TextPort>(bench.rig.board_port(), numbers, bench.settings.sensor),
        bench.rig.printer_port(), bench.settings);
  }
  /// Of a run that has to be complete: its first pass.
  CollectedPass first_pass() {
    EXPECT_TRUE(record().outcome.complete);
    return collection_of(bench.journal()).passes.at(0);
  }
  /// How far (mm) the frames' positions are from where the head was in their middle, at most.
  double worst(const CollectedPass& pass) const {
    double worst = 0;
    for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
      const float* frame = &pass.signals[64 * i];
      // The second value of a frame is that of taxel 8: row 1, column 0.
      const auto number = static_cast<std::uint64_t>(frame[0] + 1000 * frame[8]);
      const double* p = &pass.position[3 * i];
      worst = std::max(worst, distance(numbers.head(number), {p[0], p[1], p[2]}));
    }
    return worst;
  }
};

TEST(CarriedSensor, EveryFrameHasItsPositionWithAndWithoutTimeStamps) {
  for (const bool stamped : {true, false}) {
    CarriedSensor run(mat(stamped));
    const CollectedPass pass = run.first_pass();
    const Collection collection = collection_of(run.bench.journal());
    EXPECT_EQ(collection.sensor, mat(stamped));
    EXPECT_EQ(collection.bed, far_bed());
    EXPECT_EQ(collection.passes.size(), 1U);
    EXPECT_TRUE(pass.complete);
    EXPECT_EQ(pass.doubt, "");
    EXPECT_EQ(pass.missing + pass.left_out, 0U);
    EXPECT_NEAR(static_cast<double>(pass.time_s.size()), 840, 25);  // 60 mm, and up and down
    EXPECT_LT(run.worst(pass), 0.05) << "stamped " << stamped;
    EXPECT_EQ(pass.signals.size(), 64 * pass.time_s.size());
    const float* first = pass.signals.data();
    EXPECT_EQ(first[9], (first[0] + first[8] + 6 * 100) / 8) << "a dead taxel is the mean of those around";
  }
}

TEST(CarriedSensor, LostFramesAreCountedAndCostNoPosition) {
  for (const bool stamped : {true, false}) {
    CarriedSensor run(mat(stamped), running_rig({}, {.stall_rate = 0.001}));  // of 20 ms: two frames
    const CollectedPass pass = run.first_pass();
    EXPECT_GE(pass.missing, stamped ? 1U : 0U);
    // Without time stamps a loss shows a dozen frames later.
    EXPECT_LT(run.worst(pass), stamped ? 0.05 : pass.doubt.empty() ? 2 * kTrustedMm : 2);
  }
}

// The computer stands still for up to two seconds: right, left out, or said to be doubtful.
TEST(CarriedSensor, AHostThatStandsStillMakesNothingWrongInSilence) {
  for (const bool stamped : {true, false}) {
    std::size_t frames = 0;
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(mutations(4)); ++seed) {
      RigSettings rig = running_rig({}, {.host_freeze_rate = 0.0003});
      rig.seed = seed;
      CarriedSensor run(mat(stamped), rig);
      (void)run.record();
      for (const CollectedPass& pass : collection_of(run.bench.journal()).passes) {
        if (!pass.doubt.empty() || !pass.complete) continue;
        frames += pass.time_s.size();
        EXPECT_LE(run.worst(pass), kTrustedMm) << "seed " << seed << ", stamped " << stamped;
      }
    }
    EXPECT_GT(frames, 700U);
  }
}

TEST(CarriedSensor, ADamagedJournalCostsItsOwnFramesOnly) {
  CarriedSensor run(mat(true));
  (void)run.record();
  std::string bytes = read_text_file(run.bench.settings.journal, 1 << 30);
  const char of_the_sensor[] = {'S', 'T', 'J', '1', 2, 0, 0, 0};
  std::vector<std::size_t> chunks;
  for (std::size_t at = 0; (at = bytes.find({of_the_sensor, 8}, at)) != std::string::npos; ++at)
    chunks.push_back(at);
  for (const std::size_t part : {6, 7, 8}) bytes[chunks.at(chunks.size() * part / 10) + 100] ^= 1;
  bytes.resize(bytes.size() - 1000);
  const Journal journal = parse_journal(std::as_bytes(std::span(bytes)), "damaged");
  EXPECT_GT(journal.lost_bytes, 0U);
  const CollectedPass pass = collection_of(journal).passes.at(0);
  EXPECT_GT(pass.time_s.size(), 700U);
  EXPECT_GT(pass.missing, 3U);
  EXPECT_LT(run.worst(pass), 0.05) << pass.doubt;
}

TEST(CarriedSensor, AReplayThatGoesWrongForDamageSaysSo) {
  const std::vector<JournalRecord> records = {{RecordKind::clock, 1, {}}, {RecordKind::sent, 1, {}}};
  std::array<std::byte, 8> buffer{};
  ReplayPort whole(records, "whole"), damaged(records, "damaged", 5);
  EXPECT_ERROR(whole.read(buffer, 2), ReplayDiverged, "replay with the program and settings that recorded");
  const std::string says =
      "5 bytes of the journal are damaged; supertac-import --journal reads the rest of a collection's";
  EXPECT_ERROR(damaged.read(buffer, 2), JournalError, "damaged: record 0 does not follow");
  EXPECT_EQ(damaged.now(), 1);
  EXPECT_ERROR(damaged.read(buffer, 2), JournalError, says);
  EXPECT_ERROR(damaged.write(buffer, 2), ReplayDiverged, "hears nothing that is written to it");
}

// A line of two bytes, a frame of 4,096 places of which one has a taxel.
TEST(CarriedSensor, AHeaderDoesNotMakeALittleVeryLarge) {
  const TemporaryFolder folder;
  Sensor sensor = mat(false);
  sensor.array = {.rows = 64, .columns = 64, .pitch_mm = 1};
  sensor.order.assign(4096, -1), sensor.order[0] = 0, sensor.dead.clear();
  JournalWriter writer(folder / "journal", header_of(sensor, far_bed()));
  const std::byte line[] = {std::byte{'7'}, std::byte{'\n'}};
  for (int n = 0; n < 3000; ++n) writer.append(JournalStream::board, RecordKind::received, 0.01 * n, line);
  writer.close();
  EXPECT_ERROR(collection_of(read_journal(folder / "journal")), JournalError, "times what was received");
}

TEST(CarriedSensor, AHeaderWithoutASensorOrBedIsNamed) {
  const auto collect = [](const std::string& header) {
    const TemporaryFolder folder;
    JournalWriter(folder / "journal", header).close();
    return collection_of(read_journal(folder / "journal"));
  };
  EXPECT_EQ(collect("test").sensor, Sensor{});
  EXPECT_EQ(collect(R"({"version":1})").bed, Bed{});
  std::string header = header_of(mat(true), far_bed());
  EXPECT_EQ(collect(header).sensor, mat(true));
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = header;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  EXPECT_ERROR(collect(changed("\"rows\":8", "\"rows\":\"8\"")), JournalError,
               "\"sensor\": \"rows\" must be a whole number, found \"8\"");
  EXPECT_ERROR(collect(changed("\"rows\":8", "\"rows\":80")), JournalError, "rows");
  EXPECT_ERROR(collect(changed("\"passes\":1", "\"passes\":0")), JournalError,
               "\"bed\": \"passes\" must be 1 to 1000, found 0");
}

}  // namespace supertac::carried_sensor_test
