// One picture with every array on the way to it, from the recorded signals to pixels, which
// examples/recompute.py computes again.
#include <algorithm>
#include <cmath>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "data/recordings/recording.h"
#include "data/recordings/resample.h"
#include "data/windows/transforms/normalise_window.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"
#include "models/training/audit/opened_step.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

// The recorded frames that no gap separates from `at`, up to it: what the window can depend on.
Recording heard(const Recording& recording, double at, double max_gap_s) {
  const std::size_t signals = recording.array.signals();
  Recording part;
  part.array = recording.array;
  for (std::size_t i = 0; i < recording.frames() && recording.time_s[i] <= at; ++i) {
    const auto volts = std::span(recording.signals).subspan(i * signals, signals);
    if (!std::all_of(volts.begin(), volts.end(), [](float v) { return std::isfinite(v); })) continue;
    if (!part.time_s.empty() && recording.time_s[i] - part.time_s.back() > max_gap_s) {
      part.time_s.clear();
      part.signals.clear();
      part.position_mm.clear();
    }
    part.time_s.push_back(recording.time_s[i]);
    part.signals.insert(part.signals.end(), volts.begin(), volts.end());
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

// What the model takes of a recording at a time: the frames, their samples, and the last of those as a
// window.
struct Input {
  Recording frames;
  Track track;
  std::span<const float> scaled;  // of the track
  Tensor window;
};

Input input_at(const Arguments& a, const ModelFile& file) {
  const WindowSettings w = file.windows();
  const Recording recording = read_recording(a.text("recording"));
  if (recording.array != file.array())
    throw FileError(a.text("recording"), "was recorded with " + recording.array.text() +
                                             ", the model expects " + file.array().text());
  const double at = a.number("at", 0, 1e9), gap_s = std::max(w.max_gap_s, kGapPeriods * recording.period_s());
  Input input{heard(recording, at, gap_s), {}, {}, Tensor(file.model->input_shape(1))};
  const std::size_t signals = recording.array.signals(), samples = static_cast<std::size_t>(w.timesteps);
  if (input.frames.frames() > 0)
    input.track = resample(input.frames, {.rate_hz = w.rate_hz,
                                          .max_gap_s = w.max_gap_s,
                                          .frames_apart = w.timesteps == 1,
                                          .scaling = w.scaling});
  if (input.track.frames() < samples)
    throw std::runtime_error("--at " + a.text("at") + ": the model needs " + std::to_string(samples) +
                             " samples at " + format(w.rate_hz) + "/s without a gap before it, found " +
                             std::to_string(input.track.frames()) + "; choose a later time");
  input.scaled = std::span(input.track.samples).last(samples * signals);
  std::ranges::copy(input.scaled, input.window.data());
  if (w.scaling.per_window) normalise_window(input.window.values(), signals);
  return input;
}

}  // namespace

int check_picture(const Arguments& a) {
  const ModelFile file = load_model(a.text("FILE"));
  const WindowSettings w = file.windows();
  const Input input = input_at(a, file);
  add_model_parents({a.text("FILE")});
  add_parent_file("recording", a.text("recording"));
  const std::uint64_t n = input.frames.frames(), s = input.frames.array.signals();
  const auto t = static_cast<std::uint64_t>(w.timesteps);
  std::vector<Array> arrays{array("time_s", {n}, std::span<const double>(input.frames.time_s)),
                            array("volts", {n, s}, std::span<const float>(input.frames.signals)),
                            array("scaled", {t, s}, input.scaled), array("input", input.window)};
  const Json steps = trace(*file.model, input.window, arrays);
  // As programs draw it: the same numbers up to rounding, or in whole numbers.
  std::size_t count = 0;
  const Precision precision = precision_of(a.choice("precision", {"fp32", "int8"}));
  const Estimate drawn =
      compiled(file, precision).watched(input.window, [&](const std::string& step, const Tensor& map) {
        arrays.push_back(array("drawn." + std::to_string(1000 + count++).substr(1) + "." + step, map));
      });
  arrays.push_back(array("picture", drawn.picture));
  if (drawn.predicted_error.defined()) arrays.push_back(array("predicted_error", drawn.predicted_error));
  std::vector<TensorToWrite> tensors;
  for (const Array& x : arrays) tensors.push_back({x.name, x.dtype, x.shape, x.bytes});
  const Json signal = {{"rate_hz", w.rate_hz},         {"rest_volts", w.scaling.rest},
                       {"span_volts", w.scaling.span}, {"levelled", w.scaling.per_window},
                       {"least_gain", kLeastGain},     {"rest_removed", kRestRemoved}};
  write_safetensors(a.output("out"),
                    {{"kind", "explanation"}, {"steps", steps.dump()}, {"signal", signal.dump()}}, tensors);
  const double end = w.timesteps == 1 ? input.frames.time_s.back()
                                      : input.frames.time_s.front() +
                                            static_cast<double>(input.track.frames() - 1) / w.rate_hz;
  a.print(a.text("out") + ": " + std::to_string(arrays.size()) + " arrays, " + std::to_string(steps.size()) +
          " steps, of the window that ends at " + format(end, 3) + " s");
  a.write_json({{"arrays", arrays.size()}, {"steps", steps.size()}, {"window_ends_s", end}});
  return kExitOk;
}

}  // namespace supertac
