#include "apps/evaluate/exports.h"

#include <map>

#include "data/samples/split.h"
#include "io/images.h"
#include "io/safetensors.h"
#include "models/evaluation.h"

namespace supertac {
namespace {

constexpr std::size_t kStrips = 12, kFilmColumns = 24;

using Draw = Picture (*)(std::span<const Strip>, const StripLayout&);

Picture draw(const Committee& model, const WindowSet& windows, std::span<const std::uint32_t> chosen,
             Draw picture, int side) {
  const std::size_t pixels = windows.image().pixels();
  const TaxelArray array = windows.array();
  std::vector<float> outputs, truths;
  for_each_output(model, windows, chosen, [&](const EvaluatedBatch& b) {
    outputs.insert(outputs.end(), b.outputs.values().begin(), b.outputs.values().end());
    truths.insert(truths.end(), b.truths.values().begin(), b.truths.values().end());
    return true;
  });
  std::vector<std::vector<float>> frames;
  for (const std::uint32_t i : chosen) frames.push_back(mean_of_channels(array, windows.last_frame(i)));
  std::vector<Strip> strips;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    strips.push_back({frames[i], std::span<const float>(outputs).subspan(i * pixels, pixels),
                      std::span<const float>(truths).subspan(i * pixels, pixels)});
  }
  return picture(strips, {array.rows, array.columns, windows.settings().scale, side});
}

}  // namespace

OutputsFile::OutputsFile(const WindowSet& windows, std::size_t count)
    : timesteps_(static_cast<std::uint64_t>(windows.timesteps())),
      signals_(windows.array().signals()),
      height_(static_cast<std::uint64_t>(windows.image().height)),
      width_(static_cast<std::uint64_t>(windows.image().width)) {
  input_.reserve(count * timesteps_ * signals_);
  output_.reserve(count * height_ * width_);
  truth_.reserve(count * height_ * width_);
}

void OutputsFile::add(std::span<const float> window, std::span<const float> output,
                      std::span<const float> truth) {
  input_.insert(input_.end(), window.begin(), window.end());
  output_.insert(output_.end(), output.begin(), output.end());
  truth_.insert(truth_.end(), truth.begin(), truth.end());
  ++count_;
}

void OutputsFile::write(const std::string& path) const {
  const auto bytes = [](const std::vector<float>& v) { return std::as_bytes(std::span(v)); };
  write_safetensors(path, {{"format", "supertac-outputs"}},
                    {{"input", "F32", {count_, timesteps_, signals_}, bytes(input_)},
                     {"output", "F32", {count_, height_, width_}, bytes(output_)},
                     {"truth", "F32", {count_, height_, width_}, bytes(truth_)}});
}

void write_pictures(const Committee& model, const WindowSet& windows, std::span<const std::uint32_t> test,
                    OutputFolder& folder) {
  std::vector<std::uint32_t> touching;
  std::map<std::size_t, std::vector<std::uint32_t>> by_pass;
  for (const std::uint32_t i : test) {
    if (windows.contact(i)) touching.push_back(i);
    by_pass[windows.pass_of(i)].push_back(i);
  }
  const std::vector<std::uint32_t> strips = spread(touching.empty() ? test : touching, kStrips);
  write_png(folder.add("strips.png"), draw(model, windows, strips, strip_picture, 96));
  for (const auto& [pass, list] : by_pass) {
    const WindowSet::Pass& p = windows.passes()[pass];
    const std::string name = "film_" + p.plate + "_t" + std::to_string(p.trial) + "_p" +
                             std::to_string(p.pass) + "_v" + std::to_string(static_cast<int>(p.speed_mm_s)) +
                             ".png";
    write_png(folder.add(name), draw(model, windows, spread(list, kFilmColumns), film_picture, 48));
  }
}

}  // namespace supertac
