// The rig's geometry and timing, each number once. It includes nothing else of the library, so that data/
// (simulation, recordings) and hardware/ (the drivers) share it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace supertac {

struct Point3 {
  double x = 0, y = 0, z = 0;
  bool operator==(const Point3&) const = default;
};

namespace rig {

// The plate. Its own coordinates begin at its corner; the finger slides along y.
constexpr double kPlateWidthMm = 36, kPlateLengthMm = 108;  ///< in x and y
constexpr double kTextureFromMm = 36, kTextureToMm = 72;    ///< along y
constexpr double kTextureHeightMm = 2.5;
constexpr double kRidgeBaseMm = 2.5;  ///< width of a ridge

// The finger. Taxel k lies in row k / kTaxelColumns (along y) and column k % kTaxelColumns (along x).
constexpr int kTaxelRows = 4, kTaxelColumns = 4, kTaxels = kTaxelRows * kTaxelColumns;
constexpr double kTaxelPitchMm = 3;

// A run, in the printer's coordinates (mm): onset, slide along +y, release, and on to the next pass.
constexpr Point3 kStart{99.7, 101.17, 91.81};                 ///< of the first slide, in contact
constexpr Point3 kMounted{kStart.x, kStart.y, 131.81};        ///< where the head waits before and after a run
constexpr Point3 kPlate{kStart.x - 0.5, kStart.y, kStart.z};  ///< the plate's corner, at the slide's height
constexpr Point3 kBed{235, 235, 250};                         ///< how far the printer reaches from 0, 0, 0
constexpr double kSlideMm = kPlateLengthMm, kLiftMm = 5;
constexpr int kPasses = 8;
constexpr double kPassShiftMm = 5;  ///< in x
constexpr double kSlideMmS = 10;    ///< F600; the authors also slid at 5 mm/s
constexpr double kLiftMmS = 5;      ///< the z axis goes no faster
constexpr double kFastestMmS = 50;  ///< of any slide, and between passes

/// Where on the plate (mm in x) the finger's centre slides in pass 1 to kPasses.
constexpr double pass_x_mm(int pass) { return kStart.x - kPlate.x + kPassShiftMm * (pass - 1); }

// The printer.
constexpr unsigned kPrinterBaud = 115'200;

// The tactile board: a frame is 16 ticks, five patches a tick, of which the finger is patch 0.
constexpr unsigned kBoardBaud = 7'372'800;
constexpr const char* kBoardUsbId = "0483:5740";
constexpr int kFrameTicks = 16, kPatches = 5, kFrameSamples = kFrameTicks * kPatches;
constexpr std::size_t kFrameBytes = 164;
constexpr double kTickUs = 62, kFramePeriodS = kFrameTicks * kTickUs / 1e6;
constexpr double kFrameRateHz =
    1008.06;  ///< 1 / kFramePeriodS, as frames of recordings without time stamps are dated
constexpr int kAdcCodes = 4096;
constexpr double kAdcVolts = 3.3;     ///< of the code after the highest
constexpr double kRestVolts = 2.442;  ///< of a taxel that feels nothing; pressure lowers it

// What the published recordings went through.
constexpr int kFilterFrames = 100;  ///< of a moving average
constexpr double kFilterS = kFilterFrames * kFrameTicks * kTickUs / 1e6;
constexpr double kFloorVolts = 2.091, kCeilingVolts = 2.46;  ///< what they were cut to

/// Nearest code of the 12-bit converter, 0 to 4095; 0 for no number. And back, V = code * 3.3 / 4096.
inline int adc_of(double volts) {
  const double code = std::round(volts / kAdcVolts * kAdcCodes);
  return code > 0 ? static_cast<int>(std::min(code, kAdcCodes - 1.0)) : 0;
}
constexpr double volts_of(int adc) { return adc * kAdcVolts / kAdcCodes; }

}  // namespace rig
}  // namespace supertac
