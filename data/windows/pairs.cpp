#include "data/windows/pairs.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::uint64_t kMostChannels = 64, kMostPixels = 1024, kFewestPixels = 3;

std::string text(const std::vector<std::uint64_t>& shape) {
  std::string all;
  for (const std::uint64_t size : shape) all += (all.empty() ? "" : ",") + std::to_string(size);
  return "[" + all + "]";
}

void check_size(const char* what, std::size_t got, std::size_t expected) {
  if (got != expected)
    throw std::invalid_argument("pairs: " + std::string(what) + " needs room for " +
                                std::to_string(expected) + " values, got " + std::to_string(got));
}

const TensorInfo& tensor_of(const SafetensorsFile& file, const char* name, const char* shape) {
  const auto found = file.tensors().find(name);
  if (found == file.tensors().end())
    throw FileError(file.path(), std::string("has no tensor '") + name +
                                     "'; expected input F32 [N,C,H,W] and target F32 [N,1,sH,sW]");
  if (found->second.dtype != "F32" || found->second.shape.size() != 4)
    throw FileError(file.path(), std::string("tensor '") + name + "' is " + found->second.dtype + " " +
                                     text(found->second.shape) + ", expected F32 " + shape +
                                     "; convert it before saving");
  return found->second;
}

// Values of a tensor, in pieces of one pair; bytes of a file are not aligned.
template <class Use>
void for_each_value(std::span<const std::byte> bytes, const Use& use) {
  for (std::size_t i = 0; i < bytes.size() / sizeof(float); ++i) {
    float value;
    std::memcpy(&value, bytes.data() + i * sizeof value, sizeof value);
    use(i, value);
  }
}

template <class Whole>
std::vector<std::int64_t> whole_numbers(std::span<const std::byte> bytes) {
  std::vector<std::int64_t> values;
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(Whole)) {
    Whole value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    values.push_back(value);
  }
  return values;
}

}  // namespace

PairSet PairSet::read(const std::string& path) {
  PairSet pairs(SafetensorsFile::read(path));
  pairs.check_shapes();
  pairs.check_values();
  pairs.read_groups();
  return pairs;
}

PairSet::PairSet(SafetensorsFile file) : file_(std::move(file)) {}

void PairSet::check_shapes() {
  const auto& input = tensor_of(file_, "input", "[N,C,H,W]").shape;
  const auto& target = tensor_of(file_, "target", "[N,1,sH,sW]").shape;
  const auto refuse = [&](const std::string& what) {
    throw FileError(file_.path(), "input " + text(input) + ", target " + text(target) + ": " + what);
  };
  for (const std::uint64_t size : input)
    if (size < 1) refuse("no size may be 0");
  if (target[0] != input[0]) refuse("expected as many targets as inputs");
  if (target[1] != 1) refuse("expected one channel in target");
  if (input[1] > kMostChannels) refuse("expected at most 64 channels in input");
  const std::uint64_t scale = target[2] / input[2];
  const bool fits = target[2] == input[2] * scale && target[3] == input[3] * scale;
  if (!fits || (scale != 2 && scale != 4 && scale != 8 && scale != 16))
    refuse("expected target's height and width to be 2, 4, 8 or 16 times input's");
  if (std::min(target[2], target[3]) < kFewestPixels || std::max(target[2], target[3]) > kMostPixels)
    refuse("expected 3 to 1024 target pixels a side");
  count_ = input[0];
  array_ = {static_cast<int>(input[2]), static_cast<int>(input[3]), 1, static_cast<int>(input[1])};
  scale_ = static_cast<int>(scale);
  set_scaling({std::vector<float>(input[1], 0), std::vector<float>(input[1], 1)});
}

void PairSet::check_values() const {
  const auto refuse = [&](const char* tensor, std::size_t pair, float value, const char* expected) {
    throw FileError(file_.path(), std::string(tensor) + " of pair " + std::to_string(pair) + " holds " +
                                      format(value) + ", expected " + expected);
  };
  const std::size_t inputs = input_size(), targets = image().pixels();
  for_each_value(file_.bytes("input"), [&](std::size_t i, float value) {
    if (!std::isfinite(value)) refuse("input", i / inputs, value, "finite values");
  });
  for_each_value(file_.bytes("target"), [&](std::size_t i, float value) {
    if (!(value >= 0 && value <= 1)) refuse("target", i / targets, value, "0 to 1; scale the targets");
  });
}

void PairSet::read_groups() {
  const auto found = file_.tensors().find("group");
  if (found == file_.tensors().end()) return;
  const auto& [dtype, shape, begin, end] = found->second;
  if (shape != std::vector<std::uint64_t>{count_} || (dtype != "I64" && dtype != "I32"))
    throw FileError(file_.path(), "tensor 'group' is " + dtype + " " + text(shape) + ", expected I64 [" +
                                      std::to_string(count_) + "]");
  groups_ = dtype == "I64" ? whole_numbers<std::int64_t>(file_.bytes("group"))
                           : whole_numbers<std::int32_t>(file_.bytes("group"));
}

void PairSet::set_scaling(const ChannelScaling& scaling) {
  const auto channels = static_cast<std::size_t>(array_.channels);
  check_size("the scaling", scaling.mean.size() + scaling.factor.size(), 2 * channels);
  scaling_ = scaling;
}

void PairSet::input(std::size_t i, std::span<float> out) const {
  check_size("an input", out.size(), input_size());
  const auto pixels = static_cast<std::size_t>(array_.taxels()), channels = out.size() / pixels;
  for_each_value(
      file_.bytes("input").subspan(i * out.size_bytes(), out.size_bytes()), [&](std::size_t k, float value) {
        const std::size_t channel = k / pixels, pixel = k % pixels;
        out[pixel * channels + channel] = (value - scaling_.mean[channel]) * scaling_.factor[channel];
      });
}

void PairSet::target(std::size_t i, std::span<float> out) const {
  check_size("a target", out.size(), image().pixels());
  std::memcpy(out.data(), file_.bytes("target").data() + i * out.size_bytes(), out.size_bytes());
}

std::string PairSet::fingerprint() const {
  Hash hash;
  hash.add(count_);
  for (const int size : {array_.channels, array_.rows, array_.columns, scale_})
    hash.add(static_cast<std::size_t>(size));
  for (const char* name : {"input", "target"})
    for_each_value(file_.bytes(name), [&](std::size_t, float value) { hash.add(value); });
  for (const std::int64_t group : groups_) hash.add(group);
  return hash.hex();
}

void PairSet::fit_scaling(std::span<const std::uint32_t> chosen) {
  if (chosen.empty()) throw std::invalid_argument("pairs: there is no pair to fit the scaling to");
  const auto channels = static_cast<std::size_t>(array_.channels);
  set_scaling({std::vector<float>(channels, 0), std::vector<float>(channels, 1)});
  std::vector<float> values(input_size());
  std::vector<double> sum(channels), squares(channels);
  const double n = static_cast<double>(chosen.size()) * static_cast<double>(array_.taxels());
  for (int pass = 0; pass < 2; ++pass) {  // squares about the mean: nothing is lost when it is far from 0
    for (const std::uint32_t i : chosen) {
      input(i, values);
      for (std::size_t k = 0; k < values.size(); ++k) {
        const std::size_t c = k % channels;
        const double distance = double{values[k]} - sum[c];
        (pass == 0 ? sum[c] : squares[c]) += pass == 0 ? double{values[k]} : distance * distance;
      }
    }
    for (double& s : pass == 0 ? sum : squares) s /= n;
  }
  for (std::size_t c = 0; c < channels; ++c) {
    const double deviation = std::sqrt(squares[c]);
    scaling_.mean[c] = static_cast<float>(sum[c]);
    if (deviation > 1e-6 * (1e-12 + std::abs(sum[c])))
      scaling_.factor[c] = static_cast<float>(std::min(1 / deviation, 1e12));
  }
}

}  // namespace supertac
