#include "apps/evaluate/exports.h"

#include <map>

#include "data/samples/split.h"
#include "io/images.h"
#include "io/safetensors.h"
#include "models/evaluation.h"
#include "models/interval.h"

namespace supertac {
namespace {

constexpr std::size_t kStrips = 12, kFilmColumns = 24;

using Draw = Picture (*)(std::span<const Strip>, const StripLayout&);

Picture draw(const Committee& model, double interval_factor, const WindowSet& windows,
             std::span<const std::uint32_t> chosen, Draw picture, int side) {
  const std::size_t pixels = windows.image().pixels();
  const TaxelArray array = windows.array();
  std::vector<float> outputs, truths, doubts;
  for_each_output(model, windows, chosen, [&](const EvaluatedBatch& b) {
    outputs.insert(outputs.end(), b.outputs.values().begin(), b.outputs.values().end());
    truths.insert(truths.end(), b.targets.values().begin(), b.targets.values().end());
    for (const float s : b.spreads) doubts.push_back(static_cast<float>(interval_factor) * at_least(s));
    return true;
  });
  std::vector<std::vector<float>> frames;
  for (const std::uint32_t i : chosen) frames.push_back(mean_of_channels(array, windows.last_frame(i)));
  std::vector<Strip> strips;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const auto part = [&](const std::vector<float>& all) {
      return all.empty() ? std::span<const float>() : std::span(all).subspan(i * pixels, pixels);
    };
    strips.push_back({frames[i], part(outputs), part(truths), part(doubts)});
  }
  return picture(strips, {array.rows, array.columns, windows.settings().scale, side});
}

}  // namespace

OutputsFile::OutputsFile(const TaxelArray& array, std::size_t timesteps, const ImageGrid& image)
    : timesteps_(timesteps),
      signals_(array.signals()),
      height_(static_cast<std::uint64_t>(image.height)),
      width_(static_cast<std::uint64_t>(image.width)) {}

void OutputsFile::add(std::span<const float> window, std::span<const float> output,
                      std::span<const float> truth, std::span<const float> spread) {
  spread_.insert(spread_.end(), spread.begin(), spread.end());
  input_.insert(input_.end(), window.begin(), window.end());
  output_.insert(output_.end(), output.begin(), output.end());
  truth_.insert(truth_.end(), truth.begin(), truth.end());
  ++count_;
}

void OutputsFile::write(const std::string& path) const {
  const auto bytes = [](const std::vector<float>& v) { return std::as_bytes(std::span(v)); };
  std::vector<TensorToWrite> tensors{{"input", "F32", {count_, timesteps_, signals_}, bytes(input_)},
                                     {"output", "F32", {count_, height_, width_}, bytes(output_)},
                                     {"truth", "F32", {count_, height_, width_}, bytes(truth_)}};
  if (!spread_.empty()) tensors.push_back({"spread", "F32", {count_, height_, width_}, bytes(spread_)});
  write_safetensors(path, {{"format", "supertac-outputs"}}, tensors);
}

void write_pictures(const Committee& model, double interval_factor, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder) {
  std::vector<std::uint32_t> touching;
  std::map<std::size_t, std::vector<std::uint32_t>> by_pass;
  for (const std::uint32_t i : test) {
    if (windows.contact(i)) touching.push_back(i);
    by_pass[windows.pass_of(i)].push_back(i);
  }
  const std::vector<std::uint32_t> strips = spread(touching.empty() ? test : touching, kStrips);
  write_png(folder.add("strips.png"), draw(model, interval_factor, windows, strips, strip_picture, 96));
  for (const auto& [pass, list] : by_pass) {
    const WindowSet::Pass& p = windows.passes()[pass];
    const std::string name = "film_" + p.plate + "_t" + std::to_string(p.trial) + "_p" +
                             std::to_string(p.pass) + "_v" + std::to_string(static_cast<int>(p.speed_mm_s)) +
                             ".png";
    write_png(folder.add(name),
              draw(model, interval_factor, windows, spread(list, kFilmColumns), film_picture, 48));
  }
}

void write_pairs(const WindowSet& windows, std::span<const std::uint32_t> indices, const std::string& path) {
  const ImageGrid image = windows.image();
  const TaxelArray array = windows.array();
  const auto channels = static_cast<std::size_t>(array.channels);
  std::vector<float> window(windows.input_size()), input, target(indices.size() * image.pixels());
  std::vector<std::int64_t> group;
  for (std::size_t n = 0; n < indices.size(); ++n) {
    windows.input(indices[n], window);
    const auto frame = std::span<const float>(window).last(array.signals());
    for (std::size_t c = 0; c < channels; ++c)
      for (std::size_t at = c; at < frame.size(); at += channels) input.push_back(frame[at]);
    windows.target(indices[n], std::span(target).subspan(n * image.pixels(), image.pixels()));
    group.push_back(windows.group(indices[n]));
  }
  const auto size = [](auto value) { return static_cast<std::uint64_t>(value); };
  const std::uint64_t count = indices.size();
  write_safetensors(
      path, {{"format", "supertac-pairs"}, {"data", windows.fingerprint()}},
      {{"input",
        "F32",
        {count, channels, size(array.rows), size(array.columns)},
        std::as_bytes(std::span(input))},
       {"target", "F32", {count, 1, size(image.height), size(image.width)}, std::as_bytes(std::span(target))},
       {"group", "I64", {count}, std::as_bytes(std::span(group))}});
}

}  // namespace supertac
