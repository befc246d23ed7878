// What networks learn from and are tested on: windows of recordings (windows.h) or pairs of images (pairs.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "data/plates/truth.h"
#include "data/sensors/taxel_array.h"

namespace supertac {

/// Numbered examples: what a network is given, and the picture it should draw. Reading is const and safe from
/// many threads.
class Examples {
 public:
  virtual ~Examples() = default;
  virtual std::size_t size() const = 0;
  /// Frames of an input: the length of a window, 1 where there is no time.
  virtual std::size_t frames() const = 0;
  /// What an input was felt with; its pitch is 1 where nothing is known of it.
  virtual TaxelArray array() const = 0;
  /// How many times finer than the array a target is.
  virtual int scale() const = 0;

  // i < size() throughout, unchecked: these run for every sample of training.
  // Throw std::invalid_argument when `out` has another size.
  /// The input as a network takes it, [frames][signals], oldest frame first.
  virtual void input(std::size_t i, std::span<float> out) const = 0;
  /// What should be drawn, [height][width] of image().
  virtual void target(std::size_t i, std::span<float> out) const = 0;
  /// Example i is wanted soon: whoever has it in a file may have it fetched.
  virtual void will_read(std::size_t) const {}
  /// What is scored together. By its target alone an example is in contact or flat.
  virtual Zone zone(std::size_t i) const;
  /// Whether training may change the input to imitate other days: of simulated passes every one is another
  /// day already, and changes only blur.
  virtual bool augmentable(std::size_t) const { return true; }
  /// Whether the example shows what the network will be used on: the novelty alarm learns from such.
  virtual bool in_distribution(std::size_t) const { return true; }
  /// Examples of one group (a pass, a surface, a day) resemble each other.
  virtual std::int64_t group(std::size_t i) const = 0;

  /// 16 hexadecimal digits over everything: the same examples, the same text.
  virtual std::string fingerprint() const = 0;

  std::size_t input_size() const { return frames() * array().signals(); }
  ImageGrid image() const { return array().picture(scale()); }
};

}  // namespace supertac
