#include "models/files/onnx_file.h"

#include <bit>

namespace supertac {
namespace {

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

constexpr std::int64_t kIrVersion = 7, kOperatorSet = 13;

WireMessage message_of(const OnnxAttribute& a) {
  WireMessage out;
  out.bytes(attribute::name, a.name);
  if (const auto* integer = std::get_if<std::int64_t>(&a.value)) {
    out.integer(attribute::integer, *integer);
    out.integer(attribute::type, attribute::kInteger);
  } else if (const auto* number = std::get_if<float>(&a.value)) {
    out.number(attribute::number, *number);
    out.integer(attribute::type, attribute::kNumber);
  } else {
    for (const std::int64_t i : std::get<std::vector<std::int64_t>>(a.value))
      out.integer(attribute::integers, i);
    out.integer(attribute::type, attribute::kIntegers);
  }
  return out;
}

WireMessage value_info(const std::string& name, std::span<const std::int64_t> sizes,
                       const std::string& about) {
  WireMessage shape, free_size, tensor, type, out;
  free_size.bytes(value::dim_name, "N");
  shape.message(value::dim, free_size);
  for (const std::int64_t size : sizes) {
    WireMessage dim;
    dim.integer(value::dim_value, size);
    shape.message(value::dim, dim);
  }
  tensor.integer(value::element_type, static_cast<std::int64_t>(OnnxType::f32));
  tensor.message(value::shape, shape);
  type.message(value::tensor_type, tensor);
  out.bytes(value::name, name);
  out.message(value::type, type);
  out.bytes(value::doc_string, about);
  return out;
}

}  // namespace

void WireMessage::varint(std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) text_.push_back(static_cast<char>(value | 0x80));
  text_.push_back(static_cast<char>(value));
}

void WireMessage::integer(unsigned field, std::int64_t value) {
  varint(field << 3);
  varint(static_cast<std::uint64_t>(value));
}

void WireMessage::number(unsigned field, float value) {
  varint(field << 3 | 5);
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (int shift = 0; shift < 32; shift += 8) text_.push_back(static_cast<char>(bits >> shift));
}

void WireMessage::bytes(unsigned field, std::string_view value) {
  varint(field << 3 | 2);
  varint(value.size());
  text_ += value;
}

std::string OnnxGraph::node(const std::string& op, std::vector<std::string> inputs, const std::string& y,
                            std::vector<OnnxAttribute> attributes) {
  WireMessage out;
  for (const std::string& x : inputs) out.bytes(node::input, x);
  out.bytes(node::output, y);
  out.bytes(node::name, y);
  out.bytes(node::op_type, op);
  for (const OnnxAttribute& a : attributes) out.message(node::attribute, message_of(a));
  nodes_.message(graph::node, out);
  return y;
}

std::string OnnxGraph::constant(const std::string& name, OnnxType type, std::span<const std::int64_t> shape,
                                std::span<const std::byte> data) {
  WireMessage out;
  for (const std::int64_t size : shape) out.integer(tensor::dims, size);
  out.integer(tensor::data_type, static_cast<std::int64_t>(type));
  out.bytes(tensor::name, name);
  out.bytes(tensor::raw_data, {reinterpret_cast<const char*>(data.data()), data.size()});
  constants_.message(graph::initializer, out);
  return name;
}

std::string OnnxGraph::constant(const std::string& name, std::span<const std::int64_t> shape,
                                std::span<const float> values) {
  return constant(name, OnnxType::f32, shape, std::as_bytes(values));
}

std::string OnnxGraph::constant(const std::string& name, std::span<const std::int64_t> shape,
                                std::span<const std::int64_t> values) {
  return constant(name, OnnxType::i64, shape, std::as_bytes(values));
}

void OnnxGraph::input(const std::string& name, std::span<const std::int64_t> sizes,
                      const std::string& about) {
  ends_.message(graph::input, value_info(name, sizes, about));
}

void OnnxGraph::output(const std::string& name, std::span<const std::int64_t> sizes,
                       const std::string& about) {
  ends_.message(graph::output, value_info(name, sizes, about));
}

std::string OnnxGraph::file(const std::string& producer_version, const std::string& about,
                            const std::map<std::string, std::string>& metadata) const {
  WireMessage named, operators, out;
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
    WireMessage entry;
    entry.bytes(1, key);
    entry.bytes(2, text);
    out.message(model::metadata_props, entry);
  }
  return out.text();
}

}  // namespace supertac
