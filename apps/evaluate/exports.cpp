#include "apps/evaluate/exports.h"

#include <map>

#include "data/windows/split.h"
#include "io/files/safetensors.h"
#include "io/images/captions.h"
#include "io/images/images.h"
#include "io/numbers/numbers.h"
#include "models/inference/evaluation.h"
#include "models/inference/interval.h"

namespace supertac {
namespace {

constexpr std::size_t kStrips = 12, kFilmColumns = 24;

constexpr const char* kParts[] = {"felt", "drawn", "true", "off by"};

/// What is drawn of some windows, and what must outlive the strips.
struct DrawnWindows {
  std::vector<std::vector<float>> frames;
  std::vector<float> outputs, truths, doubts;
  std::vector<Strip> strips;
  std::vector<std::string> names;  // of the windows, in two lines
};

DrawnWindows drawing_of(const Ensemble& model, double interval_factor, const WindowSet& windows,
                        std::span<const std::uint32_t> chosen) {
  const std::size_t pixels = windows.image().pixels();
  DrawnWindows d;
  for_each_output(model, windows, chosen, [&](const EvaluatedBatch& b) {
    d.outputs.insert(d.outputs.end(), b.outputs.values().begin(), b.outputs.values().end());
    d.truths.insert(d.truths.end(), b.targets.values().begin(), b.targets.values().end());
    for (const float s : b.predicted_errors)
      d.doubts.push_back(static_cast<float>(interval_factor) * at_least(s));
    return true;
  });
  for (const std::uint32_t i : chosen)
    d.frames.push_back(mean_of_channels(windows.array(), windows.last_frame(i)));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const auto part = [&](const std::vector<float>& all) {
      return all.empty() ? std::span<const float>() : std::span(all).subspan(i * pixels, pixels);
    };
    d.strips.push_back({d.frames[i], part(d.outputs), part(d.truths), part(d.doubts)});
    const WindowSet::Pass& pass = windows.passes()[windows.pass_of(chosen[i])];
    d.names.push_back(pass.plate + " t" + std::to_string(pass.trial) + " p" + std::to_string(pass.pass) +
                      "\n" + windows.place_text(chosen[i]));
  }
  return d;
}

// With headings, units and a colour bar. `down`: windows stand below each other, else side by side.
Picture figure(const DrawnWindows& d, const WindowSet& windows, int side, bool down,
               const std::string& title) {
  const TaxelArray array = windows.array();
  const StripLayout layout{array.rows, array.columns, windows.settings().scale, side};
  const Picture inside = down ? strip_picture(d.strips, layout) : film_picture(d.strips, layout);
  const auto parts = static_cast<int>(d.doubts.empty() ? 3 : 4), count = static_cast<int>(d.strips.size());
  const ImageGrid image = windows.image();
  Captions captions{.title = title + "; a picture is " + format(image.width_mm()) + " x " +
                             format(image.height_mm()) + " mm",
                    .low = "0: flat plate, not pressed",
                    .high = "1: plate's highest, pressed hard"};
  const auto middle = [](int pixels, int of, int i) { return pixels * (2 * i + 1) / (2 * of); };
  for (int i = 0; i < parts; ++i)
    (down ? captions.columns : captions.rows)
        .push_back({middle(down ? inside.width : inside.height, parts, i), kParts[i]});
  for (int i = 0; i < count; ++i) {
    const std::string& name = d.names[static_cast<std::size_t>(i)];
    const std::string place = name.substr(name.find('\n') + 1);  // of a film the pass is in the title
    if (down)
      captions.rows.push_back({middle(inside.height, count, i), name});
    else if (i % 3 == 0)
      captions.columns.push_back({middle(inside.width, count, i), place});
  }
  return captioned(inside, captions);
}

}  // namespace

OutputsFile::OutputsFile(const TaxelArray& array, std::size_t timesteps, const ImageGrid& image)
    : timesteps_(timesteps),
      signals_(array.signals()),
      height_(static_cast<std::uint64_t>(image.height)),
      width_(static_cast<std::uint64_t>(image.width)) {}

void OutputsFile::add(std::span<const float> window, std::span<const float> output,
                      std::span<const float> truth, std::span<const float> predicted_error) {
  predicted_error_.insert(predicted_error_.end(), predicted_error.begin(), predicted_error.end());
  input_.insert(input_.end(), window.begin(), window.end());
  output_.insert(output_.end(), output.begin(), output.end());
  truth_.insert(truth_.end(), truth.begin(), truth.end());
  ++count_;
}

void OutputsFile::write(const OutputPath& output) const {
  const auto bytes = [](const std::vector<float>& v) { return std::as_bytes(std::span(v)); };
  std::vector<TensorToWrite> tensors{{"input", "F32", {count_, timesteps_, signals_}, bytes(input_)},
                                     {"output", "F32", {count_, height_, width_}, bytes(output_)},
                                     {"truth", "F32", {count_, height_, width_}, bytes(truth_)}};
  if (!predicted_error_.empty())
    tensors.push_back({"predicted_error", "F32", {count_, height_, width_}, bytes(predicted_error_)});
  write_safetensors(output, {{"format", "supertac-outputs"}}, tensors);
}

void write_pictures(const Ensemble& model, double interval_factor, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder) {
  std::vector<std::uint32_t> touching;
  std::map<std::size_t, std::vector<std::uint32_t>> by_pass;
  for (const std::uint32_t i : test) {
    if (windows.contact(i)) touching.push_back(i);
    by_pass[windows.pass_of(i)].push_back(i);
  }
  const auto drawing = [&](std::span<const std::uint32_t> chosen) {
    return drawing_of(model, interval_factor, windows, chosen);
  };
  const std::vector<std::uint32_t> strips = evenly_spaced(touching.empty() ? test : touching, kStrips);
  write_png(folder.add("strips.png"), figure(drawing(strips), windows, 96, true, "Windows in contact"));
  for (const auto& [pass, list] : by_pass) {
    const WindowSet::Pass& p = windows.passes()[pass];
    const std::string name = p.plate + "_t" + std::to_string(p.trial) + "_p" + std::to_string(p.pass) + "_v" +
                             std::to_string(static_cast<int>(p.speed_mm_s));
    write_png(folder.add("film_" + name + ".png"),
              figure(drawing(evenly_spaced(list, kFilmColumns)), windows, 48, false,
                     p.plate + ", trial " + std::to_string(p.trial) + ", pass " + std::to_string(p.pass) +
                         ", " + format(p.speed_mm_s) + " mm/s"));
  }
}

}  // namespace supertac
