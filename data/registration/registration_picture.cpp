#include "data/registration/registration_picture.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/plates/truth.h"
#include "data/registration/registration.h"

namespace supertac {
namespace {

constexpr double kFromMm = kPictureFromMm, kToMm = kPictureToMm;
constexpr int kPixelsPerMm = 12, kBandHeight = 12, kPlateHeight = 24, kRowGap = 6;
constexpr int kWidth = static_cast<int>((kToMm - kFromMm) * kPixelsPerMm);
constexpr Rgb kGrey = {128, 128, 128};

int column_of(double y_mm) { return static_cast<int>(std::floor((y_mm - kFromMm) * kPixelsPerMm)); }

void fill(Picture& picture, int x, int top, int height, Rgb colour) {
  for (int y = top; y < top + height; ++y) picture.set(x, y, colour);
}

// Mean depth (V below the taxel's highest voltage) of what the sliding finger felt in each column; -1 where
// no frame falls.
std::vector<float> depths(const Recording& recording, std::size_t taxel) {
  float rest = -1;
  for (std::size_t i = 0; i < recording.frames(); ++i)
    if (const float v = recording.volts[i * kTaxels + taxel]; std::isfinite(v)) rest = std::max(rest, v);
  std::vector<float> sum(kWidth), mean(kWidth, -1);
  std::vector<int> count(kWidth);
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    const double y = recording.position_mm[2 * i + 1] + row_contact_mm(recording, taxel / 4);
    const float v = recording.volts[i * kTaxels + taxel];
    if (!recording.lift_mm.empty() && recording.lift_mm[i] > 0) continue;
    if (!std::isfinite(y) || !std::isfinite(v) || y < kFromMm || y >= kToMm) continue;
    const auto column = static_cast<std::size_t>(column_of(y));
    sum[column] += rest - v, ++count[column];
  }
  for (std::size_t c = 0; c < mean.size(); ++c)
    if (count[c] > 0) mean[c] = sum[c] / static_cast<float>(count[c]);
  return mean;
}

}  // namespace

Picture registration_picture(const Recording& recording, const Plate& plate) {
  if (recording.position_mm.size() != 2 * recording.frames() || recording.frames() == 0)
    throw std::invalid_argument("registration_picture: the recording has no positions; register it first");
  if (recording.array != TaxelArray{})
    throw std::invalid_argument("registration_picture: expected the rig's " + TaxelArray{}.text() + ", got " +
                                recording.array.text());
  Picture picture(kWidth, kPlateHeight + 4 * (kRowGap + 4 * kBandHeight));
  const double x_mm = recording.position_mm[0];
  for (int x = 0; x < kWidth; ++x) {
    const double y_mm = kFromMm + (x + 0.5) / kPixelsPerMm;
    fill(picture, x, 0, kPlateHeight, colour_of(static_cast<float>(truth_value(plate, x_mm, y_mm))));
  }
  for (std::size_t k = 0; k < kTaxels; ++k) {
    const std::vector<float> depth = depths(recording, k);
    const float deepest = std::max(1e-6F, *std::max_element(depth.begin(), depth.end()));
    const int row = 3 - static_cast<int>(k / 4), column = static_cast<int>(k % 4);
    const int top = kPlateHeight + row * (kRowGap + 4 * kBandHeight) + kRowGap + column * kBandHeight;
    for (int x = 0; x < kWidth; ++x)
      if (const float d = depth[static_cast<std::size_t>(x)]; d >= 0)
        fill(picture, x, top, kBandHeight, colour_of(d / deepest));
  }
  for (const double crest : plate.crests())
    fill(picture, column_of(crest), kPlateHeight, picture.height - kPlateHeight, kGrey);
  return picture;
}

}  // namespace supertac
