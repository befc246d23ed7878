#include "models/files/exports.h"

#include <cmath>
#include <set>
#include <stdexcept>

#include "data/windows/transforms.h"
#include "io/numbers/numbers.h"
#include "models/files/onnx_file.h"
#include "models/inference/interval.h"

namespace supertac {
namespace {

using kernels::ConvSettings;
using onnx::Ints;

/// From a trace to nodes. Maps are channels-first here, [N,C,P...], as ONNX has them.
class Exporter {
 public:
  std::string picture_of(const ModelFile& file);
  onnx::Graph graph;

 private:
  using Id = const detail::Node*;

  std::string scaled(const ModelFile& file);
  std::string normalised_per_window(const std::string& x, const Scaling& scaling, Dim timesteps);
  void bin_edges(const Scaling& scaling);
  std::string percentile(const Scaling& scaling, const std::string& name, std::int64_t rank);
  std::string network_input(const ModelFile& file);

  const std::string& of(const Variable& x) const { return names_.at(x.node()); }
  std::string number(float value);
  std::string numbers(const Ints& values);
  std::string weight(const Variable& x);
  std::string new_name(const std::string& op) { return op + "_" + std::to_string(++count_); }
  std::string activated(const std::string& y, real negative_slope);
  std::string made(const TracedOp& op);
  std::string convolution(const TracedOp& op);
  std::string linear(const TracedOp& op);
  std::string gated_sum(const TracedOp& op);
  void output(const char* name, const Variable& y, const char* about);

  std::map<Id, std::string> names_;
  std::map<Id, StoredTensor> parameters_;
  std::set<std::string> written_;  // constants, named by what they are: the order of calls shall not show
  int count_ = 0;
};

std::string Exporter::number(float value) {
  const std::string name = "number_" + format(value);
  if (written_.insert(name).second) graph.constant(name, {}, std::vector{value});
  return name;
}

std::string Exporter::numbers(const Ints& values) {
  std::string name = "numbers";
  for (const std::int64_t i : values) name += "_" + std::to_string(i);
  if (written_.insert(name).second) graph.constant(name, {std::ssize(values)}, values);
  return name;
}

// In single precision, since converters know no other.
std::string Exporter::scaled(const ModelFile& file) {
  const auto rest = static_cast<float>(file.input.scaling.rest),
             span = static_cast<float>(file.input.scaling.span);
  const std::string below = graph.node("Sub", {number(rest), "volts"}, "below_rest");
  const std::string share = graph.node("Div", {below, number(span)}, "share_of_span");
  return graph.node("Clip", {share, number(0), number(1)}, "scaled");
}

// For each bin of 1/256 the last volts, from pressed hard to not at all, that Scaling counts in it or in a
// higher one: bins by comparison, which no rounding of the runtime's can change.
void Exporter::bin_edges(const Scaling& scaling) {
  const float away = scaling.span > 0 ? HUGE_VALF : -HUGE_VALF;
  std::vector<float> edges(256);
  for (std::size_t bin = 0; bin < edges.size(); ++bin) {
    const float least = static_cast<float>(bin) / 256;
    float& v = edges[bin] = static_cast<float>(scaling.rest - scaling.span * static_cast<double>(least));
    while (bin > 0 && scaling(v) >= least) v = std::nextafter(v, away);
    while (scaling(v) < least) v = std::nextafter(v, -away);
  }
  graph.constant("bin_edges", {256}, edges);
}

// Lower edge of the bin that holds the rank-th smallest sample of each signal, [N,1,signals]: the highest bin
// below which fewer samples lie, bit by bit. Not by TopK, of which converters drop the output that is not
// used.
std::string Exporter::percentile(const Scaling& scaling, const std::string& name, std::int64_t rank) {
  constexpr std::int64_t kF32 = 1, kI64 = 7;
  std::string low = number(0);
  for (int step = 128; step >= 1; step /= 2) {
    const std::string bit = name + "_" + std::to_string(step);
    const std::string bin = graph.node("Add", {low, number(static_cast<float>(step))}, bit + "_bin");
    const std::string place = graph.node("Cast", {bin}, bit + "_place", {{"to", kI64}});
    const std::string edge = graph.node("Gather", {"bin_edges", place}, bit + "_edge");
    const std::string less =
        graph.node(scaling.span > 0 ? "Greater" : "Less", {"volts", edge}, bit + "_below");
    const std::string ones = graph.node("Cast", {less}, bit + "_ones", {{"to", kF32}});
    const std::string count =
        graph.node("ReduceSum", {ones, numbers({1})}, bit + "_count", {{"keepdims", std::int64_t{1}}});
    const std::string fewer = graph.node("Less", {count, number(static_cast<float>(rank))}, bit + "_fewer");
    low = graph.node("Where", {fewer, bin, low}, bit + "_low");
  }
  return graph.node("Mul", {low, number(1.0F / 256)}, name);
}

std::string Exporter::normalised_per_window(const std::string& x, const Scaling& scaling, Dim timesteps) {
  bin_edges(scaling);
  const std::string rest = percentile(scaling, "rest", timesteps / Dim{kRestShare} + 1);
  const std::string top = percentile(scaling, "top", timesteps + 1 - Dim{kTopRank});
  const std::string removed = graph.node("Mul", {rest, number(kRestRemoved)}, "rest_removed");
  const std::string most = graph.node("ReduceMax", {graph.node("Sub", {top, removed}, "swing")},
                                      "largest_swing", {{"axes", Ints{2}}, {"keepdims", std::int64_t{1}}});
  const std::string gain = graph.node("Max", {most, number(kLeastGain)}, "gain");
  const std::string factor = graph.node("Div", {number(1), gain}, "factor");
  const std::string apart = graph.node("Sub", {x, removed}, "without_rest");
  const std::string full = graph.node("Mul", {apart, factor}, "at_full_gain");
  return graph.node("Clip", {full, number(0), number(1)}, "normalised_per_window");
}

std::string Exporter::network_input(const ModelFile& file) {
  const SuperTacSettings& s = file.model->settings();
  graph.input(
      "volts", {s.timesteps, s.signals()},
      "Volts of every signal, oldest sample first; taxel k lies in row k / columns, column k % columns.");
  const std::string x = scaled(file);
  return file.input.scaling.per_window ? normalised_per_window(x, file.input.scaling, s.timesteps) : x;
}

std::string Exporter::weight(const Variable& x) {
  const StoredTensor& p = parameters_.at(x.node());
  if (written_.insert(p.name).second) {
    Ints shape(p.shape.begin(), p.shape.end());
    // A 1x1 convolution of means is a linear layer.
    if (shape.size() == 4 && x.rank() == 2) shape.resize(2);
    graph.constant(p.name, shape, p.values);
  }
  return p.name;
}

std::string Exporter::activated(const std::string& y, real negative_slope) {
  if (negative_slope == 1) return y;
  if (negative_slope == 0) return graph.node("Relu", {y}, y + "_relu");
  return graph.node("LeakyRelu", {y}, y + "_leaky_relu", {{"alpha", static_cast<float>(negative_slope)}});
}

std::string Exporter::convolution(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const bool plane = op.inputs[0].rank() == 4;
  const auto both = [&](Dim height, Dim width) { return plane ? Ints{height, width} : Ints{width}; };
  Ints pads = both(s.padding_h, s.padding_w);
  pads.insert(pads.end(), pads.begin(), pads.begin() + (plane ? 2 : 1));
  const std::string y =
      graph.node(s.transposed ? "ConvTranspose" : "Conv",
                 {of(op.inputs[0]), weight(op.inputs[1]), weight(op.inputs[2])}, new_name(std::string(op.op)),
                 {{"kernel_shape", both(s.kernel_h, s.kernel_w)},
                  {"strides", both(s.stride_h, s.stride_w)},
                  {"pads", pads}});
  return activated(y, op.settings.negative_slope);
}

std::string Exporter::linear(const TracedOp& op) {
  const std::string y = graph.node("Gemm", {of(op.inputs[0]), weight(op.inputs[1]), weight(op.inputs[2])},
                                   new_name("linear"), {{"transB", std::int64_t{1}}});
  return activated(y, op.settings.negative_slope);
}

std::string Exporter::gated_sum(const TracedOp& op) {
  const std::string gates = graph.node("Unsqueeze", {of(op.inputs[2]), numbers({2, 3})}, new_name("gates"));
  const std::string gated = graph.node("Mul", {of(op.inputs[1]), gates}, new_name("gated"));
  return graph.node("Add", {of(op.inputs[0]), gated}, new_name("gated_sum"));
}

std::string Exporter::made(const TracedOp& op) {
  const std::string kind(op.op);
  if (kind.starts_with("conv")) return convolution(op);
  if (kind == "linear") return linear(op);
  if (kind == "gated_sum") return gated_sum(op);
  const std::string x = of(op.inputs[0]);
  if (kind == "take_runs") {
    Ints columns;
    for (Dim k = 0; k < op.y.dim(2); ++k)
      columns.push_back(op.settings.first + k / op.settings.run * op.settings.step + k % op.settings.run);
    const std::string taken =
        graph.node("Gather", {x, numbers(columns)}, new_name("group"), {{"axis", std::int64_t{2}}});
    return graph.node("Transpose", {taken}, taken + "_channels_first", {{"perm", Ints{0, 2, 1}}});
  }
  if (kind == "last_frame") {
    const std::string last = graph.node("Gather", {x, numbers({op.inputs[0].dim(1) - 1})}, "last_frame",
                                        {{"axis", std::int64_t{1}}});
    const std::string plane = graph.node(
        "Reshape", {last, numbers({-1, op.y.dim(1), op.y.dim(2), op.y.dim(3)})}, "last_frame_of_array");
    return graph.node("Transpose", {plane}, "last_frame_channels_first", {{"perm", Ints{0, 3, 1, 2}}});
  }
  if (kind == "flatten_channels_first") return graph.node("Flatten", {x}, new_name("flat"));
  if (kind == "unflatten_channels_first") {
    Ints shape = {-1, op.y.dim(op.y.rank() - 1)};
    for (int i = 1; i + 1 < op.y.rank(); ++i) shape.push_back(op.y.dim(i));
    return graph.node("Reshape", {x, numbers(shape)}, new_name("map"));
  }
  if (kind == "global_mean") {
    const std::string mean = graph.node("GlobalAveragePool", {x}, new_name("mean"));
    return graph.node("Flatten", {mean}, new_name("means"));
  }
  if (kind == "sigmoid") return graph.node("Sigmoid", {x}, new_name("sigmoid"));
  if (kind == "add") return graph.node("Add", {x, of(op.inputs[1])}, new_name("add"));
  if (kind == "concat") {
    std::vector<std::string> parts;
    for (const Variable& part : op.inputs) parts.push_back(of(part));
    return graph.node("Concat", parts, new_name("concat"), {{"axis", std::int64_t{1}}});
  }
  throw std::logic_error("export: ONNX has no counterpart of the op " + kind + "; see models/files/onnx.cpp");
}

void Exporter::output(const char* name, const Variable& y, const char* about) {
  graph.node("Reshape", {of(y), numbers({-1, y.dim(1), y.dim(2)})}, name);
  graph.output(name, {y.dim(1), y.dim(2)}, about);
}

std::string Exporter::picture_of(const ModelFile& file) {
  const SuperTac& network = *file.model;
  for (const Parameter& p : network.parameters()) parameters_.emplace(p.value.node(), to_stored(p));
  const TracedPrediction traced(network, Tensor::zeros(network.input_shape(1)));
  const Prediction& drawn = traced.drawn;
  names_[traced.input.node()] = network_input(file);
  for (const TracedOp& op : traced.trace.ops()) names_[op.y.node()] = made(op);
  output("picture", drawn.picture, "Heights over the flat plate, 0 to 1; row grows with y, column with x.");
  if (drawn.predicted_error.defined())
    output("predicted_error", drawn.predicted_error, "How far from the truth a pixel is expected to be.");
  auto metadata = file.metadata;
  if (drawn.predicted_error.defined()) metadata.emplace("interval_factor", PixelInterval{}.text());
  return graph.file("1", "SuperTac: volts in, picture out.", metadata);
}

}  // namespace

std::string onnx_of(const ModelFile& model) { return Exporter().picture_of(model); }

}  // namespace supertac
