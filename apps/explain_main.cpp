// supertac-explain: one picture with every array on the way to it, from volts to pixels.
#include <cmath>
#include <filesystem>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/explain/expression.h"
#include "apps/explain/graph.h"
#include "autograd/trace.h"
#include "data/plates/plate_file.h"
#include "data/plates/truth.h"
#include "data/recordings/recording.h"
#include "data/windows/transforms/normalise_window.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"
#include "models/inference/prepared/prepared.h"
#include "models/training/audit/opened_step.h"
#include "models/training/loss/loss.h"

namespace supertac {

void declare(Arguments& a) {
  a.positional(
      "FILE",
      "the model; or an expression on numbers, \"a=2; b=-3; relu(a*b+10)\", whose graph is drawn: + - * "
      "( ), relu( ), sigmoid( ), numbers, and names of letters that NAME=...; gives a value");
  a.option("recording", "FILE", "what was felt");
  a.option("at", "SECONDS", "on the recording's clock: the last window that ends by then");
  a.option("precision", "NAME", "fp32 or int8: of the maps that the programs' own drawing goes through",
           "fp32");
  a.required(
      "out", "FILE",
      "every array, safetensors, which examples/recompute.py computes again with NumPy; .dot or .svg: the "
      "graph of one training step on this window, or of the expression, with shapes, values y, gradients g "
      "and times. |y| and |g| are norms; shapes are memory's, where supertac-info prints the file's");
}

namespace {

using Json = nlohmann::ordered_json;

// The recorded frames that no gap separates from `at`, up to it: what the window can depend on.
Recording heard(const Recording& recording, double at, double max_gap_s) {
  const std::size_t signals = recording.array.signals();
  Recording part;
  part.array = recording.array;
  for (std::size_t i = 0; i < recording.frames() && recording.time_s[i] <= at; ++i) {
    const auto volts = std::span(recording.volts).subspan(i * signals, signals);
    if (!std::all_of(volts.begin(), volts.end(), [](float v) { return std::isfinite(v); })) continue;
    if (!part.time_s.empty() && recording.time_s[i] - part.time_s.back() > max_gap_s) {
      part.time_s.clear();
      part.volts.clear();
      part.position_mm.clear();
    }
    part.time_s.push_back(recording.time_s[i]);
    part.volts.insert(part.volts.end(), volts.begin(), volts.end());
    if (recording.position_mm.empty()) continue;
    part.position_mm.insert(part.position_mm.end(),
                            {recording.position_mm[2 * i], recording.position_mm[2 * i + 1]});
  }
  return part;
}

struct Array {
  std::string name, dtype;
  std::vector<std::uint64_t> shape;
  std::vector<std::byte> bytes;
};

template <class T>
Array array(const std::string& name, std::vector<std::uint64_t> shape, std::span<const T> values) {
  const auto bytes = std::as_bytes(values);
  return {name, sizeof(T) == 8 ? "F64" : "F32", std::move(shape), {bytes.begin(), bytes.end()}};
}

Array array(const std::string& name, const Tensor& tensor) {
  std::vector<std::uint64_t> shape;
  for (const Dim d : tensor.shape().dims()) shape.push_back(static_cast<std::uint64_t>(d));
  return array(name, std::move(shape), tensor.values());
}

// Names the results of ops by their number, and parameters as the model's file does.
class Names {
 public:
  explicit Names(const std::vector<Parameter>& parameters) {
    for (const Parameter& p : parameters) names_[p.value.value().data()] = p.name;
  }
  void add(const Tensor& tensor, const std::string& name) { names_[tensor.data()] = name; }
  const std::string& of(const Variable& x) const { return names_.at(x.value().data()); }

 private:
  std::map<const real*, std::string> names_;
};

Json step_of(const TracedOp& op, const std::string& y, const Names& names) {
  Json inputs = Json::array();
  for (const Variable& x : op.inputs) inputs.push_back(names.of(x));
  Json step = {{"y", y}, {"op", op.op}, {"inputs", inputs}};
  step.update(operator_settings(op));
  return step;
}

// Every op between the window and the picture; returns what they are, in their order.
Json trace(const SuperTac& model, const Tensor& input, std::vector<Array>& arrays) {
  const NoGrad no_grad;
  const Variable window(input);
  Trace ops;
  model.draw(window);
  Names names(model.parameters());
  names.add(input, "input");
  Json steps = Json::array();
  for (const TracedOp& op : ops.ops()) {
    const std::string number = std::to_string(1000 + steps.size()).substr(1);
    const std::string name = number + "." + std::string(op.op);
    steps.push_back(step_of(op, name, names));
    arrays.push_back(array(name, op.y.value()));
    names.add(op.y.value(), name);
  }
  return steps;
}

// The maps of the network as programs draw it, prepared: the same numbers up to rounding, or in whole
// numbers.
Estimate draw(const ModelFile& file, Precision precision, const Tensor& input, std::vector<Array>& arrays) {
  std::size_t count = 0;
  return prepared(file, precision).watched(input, [&](const std::string& step, const Tensor& map) {
    arrays.push_back(array("drawn." + std::to_string(1000 + count++).substr(1) + "." + step, map));
  });
}

int write_graph_out(const Arguments& a, const std::string& what, const std::string& dot) {
  read_option("out", [&] {
    write_graph(a.output("out"), dot);
    return 0;
  });
  a.print(a.text("out") + ": the graph of " + what);
  a.write_json({{"out", a.text("out")}});
  return kExitOk;
}

// One training step on this window; the loss is the default one, latents are their means.
int draw_graph(const Arguments& a, const ModelFile& file, const Recording& recording, const Tensor& input,
               const Track& track) {
  const SuperTacSettings& s = file.model->settings();
  const std::size_t last = 2 * track.frames() - 2;
  const float x = track.position_mm[last], y = track.position_mm[last + 1];
  if (!std::isfinite(x) || !std::isfinite(y))
    throw FileError(a.text("recording"),
                    "does not say where the finger was; a training step needs the truth");
  Tensor truth(file.model->picture_shape(1));
  const std::string folder = std::filesystem::path(a.text("recording")).parent_path();
  const ImageGrid image = file.array().picture(static_cast<int>(s.scale));
  truth_image(plate_in_folder(recording.plate, folder), x, y, image, truth.values());
  const std::vector<Tensor> eps(static_cast<std::size_t>(s.groups()), Tensor::zeros({1, s.latent}));
  return write_graph_out(
      a, "a training step",
      graph_of([&] { return supertac_loss(file.model->forward(input, eps), truth, {}).total; },
               file.model->parameters()));
}

bool is_expression(const std::string& text) {
  return text.find_first_of("+*()=") != std::string::npos && !std::filesystem::exists(text);
}

int draw_expression(const Arguments& a) {
  for (const char* other : {"recording", "at"})
    if (a.given(other))
      throw UsageError(std::string("--") + other + ": has no part in an expression; leave it out");
  Expression e;
  const auto result = [&] { return as_usage([&] { return (e = parse_expression(a.text("FILE"))).result; }); };
  return write_graph_out(a, "the expression", graph_of(result, e.leaves));
}

}  // namespace

int run(Arguments& a) {
  if (is_expression(a.text("FILE"))) return draw_expression(a);
  for (const char* needed : {"recording", "at"})
    if (!a.given(needed))
      throw UsageError(
          std::string("expected --") + needed + " with a model, found none" +
          (std::filesystem::exists(a.text("FILE"))
               ? ""
               : "; " + a.text("FILE") + " is no file, and no expression, which has one of + * ( ) ="));
  const ModelFile file = load_model(a.text("FILE"));
  const Recording recording = read_recording(a.text("recording"));
  if (recording.array != file.array())
    throw FileError(a.text("recording"), "was recorded with " + recording.array.text() +
                                             ", the model expects " + file.array().text());
  const WindowSettings w = file.windows();
  const double at = a.number("at", 0, 1e9), gap_s = std::max(w.max_gap_s, kGapPeriods * recording.period_s());
  const Recording part = heard(recording, at, gap_s);
  const std::size_t signals = part.array.signals(), frames = static_cast<std::size_t>(w.timesteps);
  const Track track = part.frames() == 0 ? Track()
                                         : resample(part, {.rate_hz = w.rate_hz,
                                                           .max_gap_s = w.max_gap_s,
                                                           .frames_apart = w.timesteps == 1,
                                                           .scaling = w.scaling});
  if (track.frames() < frames)
    throw std::runtime_error("--at " + a.text("at") + ": the model needs " + std::to_string(frames) +
                             " samples at " + format(w.rate_hz) + "/s without a gap before it, found " +
                             std::to_string(track.frames()) + "; choose a later time");
  add_model_parents({a.text("FILE")});
  add_parent_file("recording", a.text("recording"));

  const auto scaled = std::span(track.samples).last(frames * signals);
  Tensor input(file.model->input_shape(1));
  std::copy(scaled.begin(), scaled.end(), input.data());
  if (w.scaling.per_window) normalise_window(input.values(), signals);
  if (!a.text("out").ends_with(".safetensors")) return draw_graph(a, file, recording, input, track);
  const std::uint64_t n = part.frames(), t = frames, s = signals;
  std::vector<Array> arrays{array("time_s", {n}, std::span<const double>(part.time_s)),
                            array("volts", {n, s}, std::span<const float>(part.volts)),
                            array("scaled", {t, s}, scaled)};
  arrays.push_back(array("input", input));
  const Json steps = trace(*file.model, input, arrays);
  const Estimate drawn = draw(file, precision_of(a.choice("precision", {"fp32", "int8"})), input, arrays);
  arrays.push_back(array("picture", drawn.picture));
  if (drawn.predicted_error.defined()) arrays.push_back(array("predicted_error", drawn.predicted_error));

  std::vector<TensorToWrite> tensors;
  for (const Array& x : arrays) tensors.push_back({x.name, x.dtype, x.shape, x.bytes});
  const Json signal = {{"rate_hz", w.rate_hz},
                       {"rest_volts", w.scaling.rest_volts},
                       {"span_volts", w.scaling.span_volts},
                       {"levelled", w.scaling.per_window},
                       {"least_gain", kLeastGain},
                       {"rest_removed", kRestRemoved}};
  write_safetensors(a.output("out"),
                    {{"kind", "explanation"}, {"steps", steps.dump()}, {"signal", signal.dump()}}, tensors);
  const double end = w.timesteps == 1
                         ? part.time_s.back()
                         : part.time_s.front() + static_cast<double>(track.frames() - 1) / w.rate_hz;
  a.print(a.text("out") + ": " + std::to_string(arrays.size()) + " arrays, " + std::to_string(steps.size()) +
          " steps, of the window that ends at " + format(end, 3) + " s");
  a.write_json({{"arrays", arrays.size()}, {"steps", steps.size()}, {"window_ends_s", end}});
  return kExitOk;
}

}  // namespace supertac
