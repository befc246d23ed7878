// Every kind of file that a program writes: read and written again, it has the same bytes.

#include "data/plates/stl.h"
#include "data/recordings/recording.h"
#include "data/sensors/sensor.h"
#include "hardware/collection/journal.h"
#include "io/files/json.h"
#include "tests/apps/common/expect.h"
#include "tests/data/test_recordings.h"
#include "tests/support/tensor_file.h"
#include "tests/support/test.h"

namespace supertac::round_trips_test {

namespace fs = std::filesystem;

constexpr std::uint64_t kPlenty = 1 << 26;

class RoundTrips : public Training {
 protected:
  static void safetensors(const std::string& from, const std::string& to) {
    const SafetensorsFile file = SafetensorsFile::read(from);
    TensorFile(file).write(to);
    const std::string kind = value_or(file.metadata(), "kind");
    ++kinds_[kind];
    if (kind != "recording") return;
    // What the library's reader makes of it, by the library's writer.
    set_provenance(value_or(file.metadata(), kProvenanceKey));
    write_recording(to + ".typed", recording_of(file));
    set_provenance("");
    EXPECT_EQ(read_text_file(to + ".typed", kPlenty), read_text_file(from, kPlenty)) << from;
    fs::remove(to + ".typed");
  }

  static void stl(const std::string& from, const std::string& to) {
    const std::string title = read_text_file(from, kPlenty).substr(0, 80);
    write_file(to, stl_bytes(read_stl(from), title.substr(0, title.find('\0'))));
  }

  static void json_file(const std::string& from, const std::string& to) {
    if (from.ends_with(".sensor.json")) return write_sensor(to, read_sensor(from));
    write_file(to, parse_json_limited(read_text_file(from, kPlenty)).dump(2) + "\n");
  }

  // A pass as the rig's authors wrote them, imported.
  static void import_texts() {
    fs::create_directories(path("text/3_Bumps/1"));
    write_file(path("text/3_Bumps/1/1.txt"),
               text_of(read_recording(path("data/3_Bumps_t1_p1_v10.safetensors"))));
    succeed("supertac-import text --out imported");
    fs::remove_all(path("text"));
  }

  // A sensor's file by the probe, recordings and journals by a virtual rig.
  static void collect_and_probe() {
    setenv("XDG_STATE_HOME", path("state").c_str(), 1);
    RunningProcess rig =
        start("supertac-rig --plate 3_Bumps --board-link board --printer-link printer --speedup 4");
    wait_for_file(path("board"));
    wait_for_file(path("printer"));
    succeed("supertac-stream --sensor serial:" + path("board") +
            "@115200 --probe --seconds 0.5 --out board.sensor.json --quiet");
    succeed(
        "supertac-stream --board board --speedup 4 --seconds 1 --capture stream.journal --record streamed "
        "--quiet");
    succeed(
        "supertac-collect --board board --printer printer --plate 3_Bumps --passes 1 --speed 50 --speedup 4 "
        "--yes --quiet --out collected");
  }

  // How many records a chunk has is a matter of when its writer woke: the same records, not the same bytes.
  static void journal(const std::string& from, const std::string& to) {
    const Journal read = read_journal(from);
    fs::remove(to + ".journal");
    {
      JournalWriter writer(to + ".journal", read.header);
      for (const auto& [stream, records] : read.streams)
        for (const JournalRecord& record :
             stream == JournalStream::header ? std::vector<JournalRecord>() : records)
          writer.append(stream, record.kind, record.time_s, record.bytes);
      writer.close();
    }
    const Journal again = read_journal(to + ".journal");
    EXPECT_EQ(again.header, read.header);
    EXPECT_EQ(read.torn_bytes + read.lost_bytes + again.torn_bytes + again.lost_bytes, 0U);
    for (const auto& [stream, records] : read.streams) {
      ASSERT_EQ(again.of(stream).size(), records.size());
      for (std::size_t i = 0; i < records.size(); ++i)
        ASSERT_EQ(again.of(stream)[i].bytes, records[i].bytes) << i;
    }
    fs::remove(to + ".journal");
    write_file(to, read_file(from, kPlenty));
  }

  static void json_lines(const std::string& from, const std::string& to) {
    std::string all;
    const std::string text = read_text_file(from, kPlenty);
    for (std::size_t at = 0, end; at < text.size(); at = end + 1) {
      end = text.find('\n', at);
      all += parse_json_limited(text.substr(at, end - at)).dump() + "\n";
    }
    write_file(to, all);
  }

  inline static std::map<std::string, int> kinds_;
};

TEST_F(RoundTrips, OfEveryKindOfFileGiveTheSameBytes) {
  const std::string of_pass = " --recording data/3_Bumps_t1_p1_v10.safetensors ";
  trained("m.safetensors", "--ledger 1000 --json train.json");
  succeed("supertac-plate --plate bumps6 --out plate.stl --json plate.json");
  succeed(
      "supertac-evaluate --model m.safetensors --data data --limit 30 --outputs outputs.safetensors "
      "--pictures pictures --report report.html --json evaluate.json");
  succeed("supertac-export m.safetensors --onnx m.onnx");
  succeed("supertac-export m.safetensors --c99 c99");
  succeed("supertac-stream --model m.safetensors --out stream.safetensors --json stream.json --quiet" +
          of_pass);
  succeed("supertac-simulate --sensor " SUPERTAC_SOURCE
          "/examples/sensors/csv_arduino.json --out mat --plates "
          "plain --trials 1 --passes 1");
  succeed("supertac-sweep" + options("sweep", "--epochs 1 --seeds 0"));
  import_texts();
  collect_and_probe();

  // Those that are for people and other programs are not read by ours.
  const std::set<std::string> not_read = {".html", ".png", ".onnx", ".csv", ".h", ".c"};
  const std::map<std::string, std::function<void(const std::string&, const std::string&)>> again = {
      {".safetensors", safetensors},
      {".stl", stl},
      {".json", json_file},
      {".jsonl", json_lines},
      {".journal", journal}};
  std::map<std::string, int> seen;
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(path("")))
    if (entry.is_regular_file()) files.push_back(entry.path());
  for (const std::string& file : files) {
    const std::string kind = fs::path(file).extension();
    ++seen[kind];
    if (not_read.contains(kind)) continue;
    ASSERT_TRUE(again.contains(kind)) << file << ": a kind of file that this test does not know";
    again.at(kind)(file, path("again"));
    EXPECT_EQ(read_text_file(path("again"), kPlenty), read_text_file(file, kPlenty)) << file;
  }
  for (const auto& [kind, rewrite] : again) EXPECT_GT(seen[kind], 0) << kind;
  for (const std::string& kind : not_read) EXPECT_GT(seen[kind], 0) << kind;
  for (const char* kind : {"recording", "pictures", ""})  // "": a model
    EXPECT_GT(kinds_[kind], 0) << kind;

  // What a finished run is resumed from, its log and its model.
  const auto kept = [&] {
    return bytes("m.run/last.safetensors") + bytes("m.run/log.csv") + bytes("m.safetensors");
  };
  const std::string before = kept();
  trained("m.safetensors", "--resume m.run/last.safetensors --force");
  EXPECT_EQ(kept(), before);
}

}  // namespace supertac::round_trips_test
