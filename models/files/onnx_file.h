// The bytes of an ONNX file. It is a message of Protocol Buffers, whose wire format is a list of (number,
// kind, value): that much is written here, so that no code generator and no shared library of 3 MB comes with
// every program. Source: onnx.proto3 of ONNX 1.8 (IR version 7, operator set 13).
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace supertac {

/// A message of Protocol Buffers, field behind field.
class WireMessage {
 public:
  void integer(unsigned field, std::int64_t value);
  void number(unsigned field, float value);
  void bytes(unsigned field, std::string_view value);
  void message(unsigned field, const WireMessage& value) { bytes(field, value.text_); }
  const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value);
  std::string text_;
};

enum class OnnxType { f32 = 1, i64 = 7 };

struct OnnxAttribute {
  std::string name;
  std::variant<std::int64_t, float, std::vector<std::int64_t>> value;
};

/// A graph of ops over named arrays, in the order in which they run.
class OnnxGraph {
 public:
  /// y = op(inputs); returns y. Names are the caller's and must differ.
  std::string node(const std::string& op, std::vector<std::string> inputs, const std::string& y,
                   std::vector<OnnxAttribute> attributes = {});
  // Constants; return their name. An empty shape is a single number.
  std::string constant(const std::string& name, std::span<const std::int64_t> shape,
                       std::span<const float> values);
  std::string constant(const std::string& name, std::span<const std::int64_t> shape,
                       std::span<const std::int64_t> values);

  // [N, sizes], N being any number.
  void input(const std::string& name, std::span<const std::int64_t> sizes, const std::string& about);
  void output(const std::string& name, std::span<const std::int64_t> sizes, const std::string& about);

  /// The file's bytes; the same graph gives the same bytes.
  std::string file(const std::string& producer_version, const std::string& about,
                   const std::map<std::string, std::string>& metadata) const;

 private:
  std::string constant(const std::string& name, OnnxType type, std::span<const std::int64_t> shape,
                       std::span<const std::byte> data);
  WireMessage nodes_, constants_, ends_;
};

}  // namespace supertac
