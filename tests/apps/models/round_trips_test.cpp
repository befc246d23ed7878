// Every kind of file that a program writes: read and written again, it has the same bytes.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "data/plates/stl.h"
#include "data/recordings/recording.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "tests/apps/common/trained.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kPlenty = 1 << 26;

class RoundTrips : public Training {
 protected:
  static void run(const std::string& program, const std::vector<std::string>& arguments) {
    const ProcessResult result = run_process(program, arguments);
    ASSERT_EQ(result.code, 0) << program << ": " << result.error;
  }

  static void safetensors(const std::string& from, const std::string& to) {
    const SafetensorsFile file = SafetensorsFile::read(from);
    std::vector<TensorToWrite> tensors;
    for (const auto& [name, info] : file.tensors())
      tensors.push_back({name, info.dtype, info.shape, file.bytes(name)});
    std::ranges::sort(tensors, {}, [&](const TensorToWrite& t) { return file.tensors().at(t.name).begin; });
    write_safetensors(to, file.metadata(), tensors);
    if (!file.metadata().contains("kind") || file.metadata().at("kind") != "recording") return;
    const std::string typed = to + ".typed";
    set_provenance(file.metadata().contains(kProvenanceKey) ? file.metadata().at(kProvenanceKey) : "");
    write_recording(typed, recording_of(file));
    set_provenance("");
    EXPECT_EQ(read_text_file(typed, kPlenty), read_text_file(from, kPlenty)) << from;
  }

  static void stl(const std::string& from, const std::string& to) {
    const std::string title = read_text_file(from, kPlenty).substr(0, 80);
    write_file(to, stl_bytes(read_stl(from), title.substr(0, title.find('\0'))));
  }

  static void json(const std::string& from, const std::string& to) {
    write_file(to, parse_json_limited(read_text_file(from, kPlenty)).dump(2) + "\n");
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
};

TEST_F(RoundTrips, OfEveryKindOfFileGiveTheSameBytes) {
  const std::string recording = path("data/3_Bumps_t1_p1_v10.safetensors"), model = path("m.safetensors");
  ASSERT_EQ(train("m.safetensors", {"--ledger", "1000", "--json", path("train.json")}).code, 0);
  run("supertac-plate", {"--plate", "bumps6", "--resolution", "2", "--out", path("plate.stl"), "--gcode",
                         path("plate.gcode"), "--json", path("plate.json")});
  run("supertac-evaluate",
      {"--model", model, "--data", path("data"), "--limit", "30", "--outputs", path("outputs.safetensors"),
       "--pictures", path("pictures"), "--report", path("report.html"), "--write-pairs", path("pairs"),
       "--json", path("evaluate.json")});
  run("supertac-explain",
      {model, "--recording", recording, "--at", "6", "--out", path("explained.safetensors")});
  run("supertac-explain", {"a=2; b=-3; a*b", "--out", path("graph.dot")});
  run("supertac-export", {model, "--onnx", path("m.onnx")});
  run("supertac-stream", {"--recording", recording, "--model", model, "--out", path("stream.safetensors"),
                          "--json", path("stream.json"), "--quiet"});

  // Those that are for people and other programs are not read by ours.
  const std::set<std::string> not_read = {".html", ".png", ".gcode", ".dot", ".onnx", ".csv"};
  const std::map<std::string, std::function<void(const std::string&, const std::string&)>> again = {
      {".safetensors", safetensors}, {".stl", stl}, {".json", json}, {".jsonl", json_lines}};
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

  // What a finished run is resumed from, its log and its model.
  const auto kept = [&] {
    return bytes("m.run/last.safetensors") + bytes("m.run/log.csv") + bytes("m.safetensors");
  };
  const std::string before = kept();
  ASSERT_EQ(train("m.safetensors", {"--resume", path("m.run/last.safetensors"), "--force"}).code, 0);
  EXPECT_EQ(kept(), before);
}

}  // namespace
}  // namespace supertac
