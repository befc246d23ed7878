// Pairs of low- and high-resolution tactile images from any sensor: another way to training than recordings.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/samples/split.h"
#include "io/safetensors.h"

namespace supertac {

/// What brings a channel of the input near 0 and 1: (x - mean) * factor.
struct ChannelScaling {
  std::vector<float> mean, factor;  ///< one for each channel
};

/// Paired images of one file. Nothing is copied but what is asked for.
class PairSet {
 public:
  /// Reads a safetensors file with tensors
  ///   input   F32 [N,C,H,W]    what the sensor gives: N frames of H x W taxels (or pixels), C channels
  ///   target  F32 [N,1,sH,sW]  what is to be drawn, in [0,1]; s is 2, 4, 8 or 16
  ///   group   I64 or I32 [N]   optional: frames of one group (a pass, a surface, a day) belong together
  /// N, C >= 1, H, W >= 1, at least 7 and at most 1024 target pixels a side, at most 64 channels.
  /// Throws FileError naming the tensor, what was expected and found; values that are not finite or a target
  /// outside [0,1] are named by their pair.
  static PairSet read(const std::string& path);

  std::size_t size() const { return count_; }
  std::size_t channels() const { return channels_; }
  std::size_t height() const { return height_; }
  std::size_t width() const { return width_; }
  std::size_t scale() const { return scale_; }
  std::size_t target_height() const { return height_ * scale_; }
  std::size_t target_width() const { return width_ * scale_; }
  bool grouped() const { return !groups_.empty(); }
  /// 0 for all when the file has no groups.
  std::int64_t group(std::size_t i) const { return grouped() ? groups_[i] : 0; }

  // i < size(), unchecked. Throws std::invalid_argument when `out` or the scaling has another size.
  /// The input as the networks take it, [H][W][C], scaled.
  void input(std::size_t i, const ChannelScaling& scaling, std::span<float> out) const;
  /// [sH][sW]
  void target(std::size_t i, std::span<float> out) const;

  /// 16 hexadecimal digits over sizes, values and groups.
  std::string fingerprint() const;

 private:
  explicit PairSet(SafetensorsFile file);
  void check_shapes();
  void check_values() const;
  void read_groups();
  std::span<const std::byte> input_bytes(std::size_t i) const;

  SafetensorsFile file_;
  std::size_t count_ = 0, channels_ = 0, height_ = 0, width_ = 0, scale_ = 0;
  std::vector<std::int64_t> groups_;
};

/// Mean and 1 / standard deviation of every channel over the given pairs; factor 1 for a channel that never
/// changes. Throws std::invalid_argument when there is no pair.
ChannelScaling fit_scaling(const PairSet& pairs, std::span<const std::uint32_t> chosen);

/// How pairs are divided:
///   group  a random fifth of the groups (rounded, at least one) is tested: unseen passes, surfaces, days
///   pair   a random fifth of the pairs is tested. Leaky when neighbours resemble each other.
///   none   all pairs are in both
/// Random choices are EpochOrder(count, seed, 0); groups are counted in ascending order.
/// Throws std::invalid_argument for another name, no groups, or a side that would be empty.
Split split_pairs(const PairSet& pairs, const std::string& kind, std::uint64_t seed);

}  // namespace supertac
