// Pairs of low- and high-resolution tactile images from any sensor: another way to training than recordings.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/windows/examples.h"
#include "io/files/safetensors.h"

namespace supertac {

/// What brings a channel of the input near 0 and 1: (x - mean) * factor.
struct ChannelScaling {
  std::vector<float> mean, factor;  ///< one for each channel
};

/// Paired images of one file. Nothing is copied but what is asked for.
class PairSet : public Examples {
 public:
  /// Reads a safetensors file with tensors
  ///   input   F32 [N,C,H,W]    what the sensor gives: N frames of H x W taxels (or pixels), C channels
  ///   target  F32 [N,1,sH,sW]  what is to be drawn, in [0,1]; s is 2, 4, 8 or 16
  ///   group   I64 or I32 [N]   optional: frames of one group (a pass, a surface, a day) belong together
  /// N, C >= 1, H, W >= 1, at least 3 and at most 1024 target pixels a side, at most 64 channels.
  /// Throws FileError naming the tensor, what was expected and found; values that are not finite or a target
  /// outside [0,1] are named by their pair.
  static PairSet read(const std::string& path);

  /// Sets the scaling of the inputs, which is none before: mean and 1 / standard deviation of every channel
  /// over the given pairs; factor 1 for a channel that never changes. Throws std::invalid_argument when there
  /// is no pair.
  void fit_scaling(std::span<const std::uint32_t> chosen);
  /// Throws std::invalid_argument when it is for another number of channels.
  void set_scaling(const ChannelScaling& scaling);
  const ChannelScaling& scaling() const { return scaling_; }

  std::size_t size() const override { return count_; }
  std::size_t frames() const override { return 1; }
  TaxelArray array() const override { return array_; }
  int scale() const override { return scale_; }
  bool grouped() const { return !groups_.empty(); }
  /// 0 for all when the file has no groups.
  std::int64_t group(std::size_t i) const override { return grouped() ? groups_[i] : 0; }
  /// [H][W][C], scaled.
  void input(std::size_t i, std::span<float> out) const override;
  void target(std::size_t i, std::span<float> out) const override;
  /// Over sizes, values and groups.
  std::string fingerprint() const override;

 private:
  explicit PairSet(SafetensorsFile file);
  void check_shapes();
  void check_values() const;
  void read_groups();

  SafetensorsFile file_;
  std::size_t count_ = 0;
  TaxelArray array_;
  int scale_ = 0;
  ChannelScaling scaling_;
  std::vector<std::int64_t> groups_;
};

}  // namespace supertac
