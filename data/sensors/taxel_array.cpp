#include "data/sensors/taxel_array.h"

#include <stdexcept>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

std::string Pitch::text() const { return x == y ? format(x) : format(x) + " x " + format(y); }

std::string ImageGrid::text() const { return std::to_string(height) + "x" + std::to_string(width); }

std::string TaxelArray::text() const {
  return std::to_string(rows) + "x" + std::to_string(columns) + " taxels at " + pitch_mm.text() + " mm" +
         (channels == 1 ? "" : " with " + std::to_string(channels) + " channels");
}

void TaxelArray::check() const {
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  if (within(rows, 1, 64) && within(columns, 1, 64) && within(channels, 1, 8) &&
      within(pitch_mm.x, 0.1, 100) && within(pitch_mm.y, 0.1, 100))
    return;
  throw std::invalid_argument(refusal(
      "array", "layout", "1 to 64 rows and columns, 1 to 8 channels, a pitch of 0.1 to 100 mm", text()));
}

std::vector<float> mean_of_channels(const TaxelArray& array, std::span<const float> frame) {
  expect_values("mean_of_channels", "frame", array.signals(), frame.size());
  const auto channels = static_cast<std::size_t>(array.channels);
  std::vector<float> mean(frame.size() / channels);
  for (std::size_t s = 0; s < frame.size(); ++s)
    mean[s / channels] += frame[s] / static_cast<float>(array.channels);
  return mean;
}

}  // namespace supertac
