// supertac-pairs: recordings as pairs of images, for networks that know no time (supertac-train --pairs).
#include "apps/common/output_folder.h"
#include "apps/common/program.h"
#include "apps/common/version.h"
#include "data/samples/split.h"
#include "io/safetensors.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("data", "DIR", "recordings");
  a.required("out", "DIR", "gets train.safetensors and test.safetensors");
  a.option("plates", "A,B,...", "only recordings of these plates (default: all)");
  a.option("split", "NAME", "which windows go where: window, pass, trial, texture", "trial");
  a.option("seed", "N", "of the split", "0");
  a.option("timesteps", "T", "the windows are those that a model of T samples is trained on", "256");
  a.option("scale", "N", "targets N times as fine as the array: 2, 4 or 8", "4");
  a.option("stride", "N", "take every N-th window of a pass", "1");
}

namespace {

// input [N,channels,rows,columns]: the window's last frame, scaled; target [N,1,H,W]; group [N]: the number
// of the pass.
nlohmann::ordered_json write(const WindowSet& windows, const std::vector<std::uint32_t>& indices,
                             const std::string& path) {
  const ImageGrid image = windows.image();
  const std::size_t pixels = image.pixels();
  const TaxelArray array = windows.array();
  const auto channels = static_cast<std::size_t>(array.channels);
  std::vector<float> input, target(indices.size() * pixels);
  std::vector<std::int64_t> group;
  for (std::size_t n = 0; n < indices.size(); ++n) {
    const auto frame = windows.last_frame(indices[n]);
    for (std::size_t c = 0; c < channels; ++c)
      for (std::size_t at = c; at < frame.size(); at += channels) input.push_back(frame[at]);
    windows.truth(indices[n], std::span(target).subspan(n * pixels, pixels));
    group.push_back(static_cast<std::int64_t>(windows.pass_of(indices[n])));
  }
  const std::uint64_t count = indices.size();
  write_safetensors(
      path, {{"format", "supertac-pairs"}, {"data", windows.fingerprint()}},
      {{"input",
        "F32",
        {count, channels, static_cast<std::uint64_t>(array.rows), static_cast<std::uint64_t>(array.columns)},
        std::as_bytes(std::span(input))},
       {"target",
        "F32",
        {count, 1, static_cast<std::uint64_t>(image.height), static_cast<std::uint64_t>(image.width)},
        std::as_bytes(std::span(target))},
       {"group", "I64", {count}, std::as_bytes(std::span(group))}});
  return {{"file", path}, {"pairs", count}};
}

}  // namespace

int run(Arguments& a) {
  WindowSettings w;
  w.timesteps = static_cast<int>(a.integer("timesteps", 1, 4096));
  w.scale = std::stoi(a.choice("scale", {"2", "4", "8"}));
  w.stride = static_cast<int>(a.integer("stride", 1, 100'000));
  const SplitKind kind = split_kind(a.choice("split", {"window", "pass", "trial", "texture"}));
  const auto seed =
      static_cast<std::uint64_t>(a.integer("seed", 0, std::numeric_limits<std::int64_t>::max()));
  OutputFolder folder(a.text("out"), a.force());
  const std::string train = folder.add("train.safetensors"), test = folder.add("test.safetensors");
  const WindowSet windows = WindowSet::load(a.text("data"), a.list("plates"), w);
  const Split split = make_split(windows, kind, seed);
  nlohmann::ordered_json result = {{"command", a.command_line()}, {"commit", commit()}};
  result["train"] = write(windows, split.train, train);
  result["test"] = write(windows, split.test, test);
  folder.keep();
  a.print(a.text("out") + ": " + std::to_string(split.train.size()) + " pairs to train on, " +
          std::to_string(split.test.size()) + " to test");
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
