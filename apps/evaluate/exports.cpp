#include "apps/evaluate/exports.h"

#include <map>

#include "apps/evaluate/scoring.h"
#include "data/windows/split.h"
#include "io/files/safetensors.h"
#include "io/images/captions.h"
#include "io/images/images.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::size_t kStrips = 12, kFilmColumns = 24;

constexpr const char* kParts[] = {"felt", "drawn", "true", "off by"};

// With headings, units and a colour bar. `down`: windows stand below each other, else side by side.
Picture figure(const std::vector<ShownWindow>& shown, std::span<const std::uint32_t> chosen,
               const WindowSet& windows, int side, bool down, const std::string& title) {
  const TaxelArray array = windows.array();
  const StripLayout layout{array.rows, array.columns, windows.settings().scale, side};
  std::vector<Strip> strips;
  for (const ShownWindow& w : shown) strips.push_back({w.input, w.drawn, w.truth, w.half_widths});
  const Picture inside = down ? strip_picture(strips, layout) : film_picture(strips, layout);
  const int parts = shown.empty() || shown.front().half_widths.empty() ? 3 : 4,
            count = static_cast<int>(strips.size());
  const ImageGrid image = windows.image();
  Captions captions{.title = title + "; a picture is " + format(image.width_mm()) + " x " +
                             format(image.height_mm()) + " mm",
                    .low = "0: nothing, not pressed",
                    .high = "1: the highest, pressed hard"};
  const auto middle = [](int pixels, int of, int i) { return pixels * (2 * i + 1) / (2 * of); };
  for (int i = 0; i < parts; ++i)
    (down ? captions.columns : captions.rows)
        .push_back({middle(down ? inside.width : inside.height, parts, i), kParts[i]});
  for (int i = 0; i < count; ++i) {
    const std::uint32_t window = chosen[static_cast<std::size_t>(i)];
    const WindowSet::Pass& pass = windows.passes()[windows.pass_of(window)];
    const std::string place = windows.place_text(window);  // of a film the pass is in the title
    if (down)
      captions.rows.push_back(
          {middle(inside.height, count, i),
           pass.plate + " t" + std::to_string(pass.trial) + " p" + std::to_string(pass.pass) + "\n" + place});
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
                      std::span<const float> truth, std::span<const float> predicted_error,
                      const WindowSet::Position& position, std::size_t pass) {
  predicted_error_.insert(predicted_error_.end(), predicted_error.begin(), predicted_error.end());
  input_.insert(input_.end(), window.begin(), window.end());
  output_.insert(output_.end(), output.begin(), output.end());
  truth_.insert(truth_.end(), truth.begin(), truth.end());
  position_mm_.insert(position_mm_.end(), {position.x_mm, position.y_mm});
  pass_.push_back(static_cast<std::int64_t>(pass));
  ++count_;
}

void OutputsFile::write(const OutputPath& output) const {
  const auto bytes = [](const std::vector<float>& v) { return std::as_bytes(std::span(v)); };
  std::vector<TensorToWrite> tensors{
      {"input", "F32", {count_, timesteps_, signals_}, bytes(input_)},
      {"output", "F32", {count_, height_, width_}, bytes(output_)},
      {"truth", "F32", {count_, height_, width_}, bytes(truth_)},
      {"position_mm", "F64", {count_, 2}, std::as_bytes(std::span(position_mm_))},
      {"pass", "I64", {count_}, std::as_bytes(std::span(pass_))}};
  if (!predicted_error_.empty())
    tensors.push_back({"predicted_error", "F32", {count_, height_, width_}, bytes(predicted_error_)});
  write_safetensors(output, {{"format", "supertac-outputs"}}, tensors);
}

void write_pictures(const Ensemble& model, const PixelInterval& interval, const WindowSet& windows,
                    std::span<const std::uint32_t> test, OutputFolder& folder) {
  std::vector<std::uint32_t> touching;
  std::map<std::size_t, std::vector<std::uint32_t>> by_pass;
  for (const std::uint32_t i : test) {
    if (windows.contact(i)) touching.push_back(i);
    by_pass[windows.pass_of(i)].push_back(i);
  }
  const auto drawn = [&](const std::vector<std::uint32_t>& chosen, int side, bool down,
                         const std::string& title) {
    return figure(draw_again(model, windows, chosen, interval), chosen, windows, side, down, title);
  };
  write_png(folder.add("strips.png"), drawn(evenly_spaced(touching.empty() ? test : touching, kStrips), 96,
                                            true, "Windows in contact"));
  for (const auto& [pass, list] : by_pass) {
    const WindowSet::Pass& p = windows.passes()[pass];
    const std::string name = p.plate + "_t" + std::to_string(p.trial) + "_p" + std::to_string(p.pass) + "_v" +
                             std::to_string(static_cast<int>(p.speed_mm_s));
    write_png(folder.add("film_" + name + ".png"),
              drawn(evenly_spaced(list, kFilmColumns), 48, false,
                    p.plate + ", trial " + std::to_string(p.trial) + ", pass " + std::to_string(p.pass) +
                        ", " + format(p.speed_mm_s) + " mm/s"));
  }
}

}  // namespace supertac
