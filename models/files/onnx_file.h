// The bytes of an ONNX file. It is a message of Protocol Buffers, whose wire format is a list of (number,
// kind, value): that much is written here, so that no code generator and no shared library of 3 MB comes with
// every program. Source: onnx.proto3 of ONNX 1.8 (IR version 7, operator set 13).
#pragma once

#include <bit>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace supertac::onnx {

// Field numbers of onnx.proto3, message by message.
namespace model {
enum : unsigned {
  ir_version = 1,
  producer_name,
  producer_version,
  doc_string = 6,
  graph,
  opset_import,
  metadata_props = 14
};
}
namespace graph {
enum : unsigned { node = 1, name, initializer = 5, input = 11, output };
}
namespace node {
enum : unsigned { input = 1, output, name, op_type, attribute };
}
namespace attribute {
enum : unsigned { name = 1, number, integer, integers = 8, type = 20 };
enum : int { kNumber = 1, kInteger = 2, kIntegers = 7 };
}  // namespace attribute
namespace tensor {
enum : unsigned { dims = 1, data_type, name = 8, raw_data };
}
namespace value {
enum : unsigned { name = 1, type, doc_string };
enum : unsigned { tensor_type = 1, element_type = 1, shape, dim = 1, dim_value = 1, dim_name };
}  // namespace value

enum class Type { f32 = 1, i64 = 7 };
using Ints = std::vector<std::int64_t>;

/// A message of Protocol Buffers, field behind field.
class Message {
 public:
  void integer(unsigned field, std::int64_t value) {
    varint(field << 3);
    varint(static_cast<std::uint64_t>(value));
  }
  void number(unsigned field, float value) {
    varint(field << 3 | 5);
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (int shift = 0; shift < 32; shift += 8) text_.push_back(static_cast<char>(bits >> shift));
  }
  void bytes(unsigned field, std::string_view value) {
    varint(field << 3 | 2);
    varint(value.size());
    text_ += value;
  }
  void message(unsigned field, const Message& value) { bytes(field, value.text_); }
  const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) text_.push_back(static_cast<char>(value | 0x80));
    text_.push_back(static_cast<char>(value));
  }
  std::string text_;
};

struct Attribute {
  std::string name;
  std::variant<std::int64_t, float, Ints> value;

  Message message() const {
    Message out;
    out.bytes(attribute::name, name);
    if (const auto* integer = std::get_if<std::int64_t>(&value)) {
      out.integer(attribute::integer, *integer);
      out.integer(attribute::type, attribute::kInteger);
    } else if (const auto* number = std::get_if<float>(&value)) {
      out.number(attribute::number, *number);
      out.integer(attribute::type, attribute::kNumber);
    } else {
      for (const std::int64_t i : std::get<Ints>(value)) out.integer(attribute::integers, i);
      out.integer(attribute::type, attribute::kIntegers);
    }
    return out;
  }
};

/// A graph of ops over named arrays, in the order in which they run.
class Graph {
 public:
  /// y = op(inputs); returns y. Names are the caller's and must differ.
  std::string node(const std::string& op, const std::vector<std::string>& inputs, const std::string& y,
                   const std::vector<Attribute>& attributes = {}) {
    Message out;
    for (const std::string& x : inputs) out.bytes(node::input, x);
    out.bytes(node::output, y);
    out.bytes(node::name, y);
    out.bytes(node::op_type, op);
    for (const Attribute& a : attributes) out.message(node::attribute, a.message());
    nodes_.message(graph::node, out);
    return y;
  }
  /// Of floats or whole numbers; returns the name. An empty shape is a single number.
  template <class T>
  std::string constant(const std::string& name, const Ints& shape, const std::vector<T>& values) {
    Message out;
    for (const std::int64_t size : shape) out.integer(tensor::dims, size);
    constexpr Type type = std::is_same_v<T, float> ? Type::f32 : Type::i64;
    out.integer(tensor::data_type, static_cast<std::int64_t>(type));
    out.bytes(tensor::name, name);
    out.bytes(tensor::raw_data, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
    constants_.message(graph::initializer, out);
    return name;
  }
  // Of floats [N, sizes], N being any number.
  void input(const std::string& name, const Ints& sizes, const std::string& about) {
    ends_.message(graph::input, value_info(name, sizes, about));
  }
  void output(const std::string& name, const Ints& sizes, const std::string& about) {
    ends_.message(graph::output, value_info(name, sizes, about));
  }

  /// The file's bytes; the same graph gives the same bytes.
  std::string file(const std::string& producer_version, const std::string& about,
                   const std::map<std::string, std::string>& metadata) const {
    constexpr std::int64_t kIrVersion = 7, kOperatorSet = 13;
    Message named, operators, out;
    named.bytes(graph::name, "supertac");
    operators.bytes(1, "");  // the domain of ONNX's own ops
    operators.integer(2, kOperatorSet);
    out.integer(model::ir_version, kIrVersion);
    out.bytes(model::producer_name, "supertac");
    out.bytes(model::producer_version, producer_version);
    out.bytes(model::doc_string, about);
    // The fields of a message may stand in any order.
    out.bytes(model::graph, nodes_.text() + named.text() + constants_.text() + ends_.text());
    out.message(model::opset_import, operators);
    for (const auto& [key, text] : metadata) {
      Message entry;
      entry.bytes(1, key);
      entry.bytes(2, text);
      out.message(model::metadata_props, entry);
    }
    return out.text();
  }

 private:
  static Message value_info(const std::string& name, const Ints& sizes, const std::string& about) {
    Message shape, free_size, tensor, type, out;
    free_size.bytes(value::dim_name, "N");
    shape.message(value::dim, free_size);
    for (const std::int64_t size : sizes) {
      Message dim;
      dim.integer(value::dim_value, size);
      shape.message(value::dim, dim);
    }
    tensor.integer(value::element_type, static_cast<std::int64_t>(Type::f32));
    tensor.message(value::shape, shape);
    type.message(value::tensor_type, tensor);
    out.bytes(value::name, name);
    out.message(value::type, type);
    out.bytes(value::doc_string, about);
    return out;
  }

  Message nodes_, constants_, ends_;
};

}  // namespace supertac::onnx
