#include "layers/checkpoint.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

std::vector<std::uint64_t> file_shape(const Parameter& p) {
  const std::span<const Dim> dims = p.value.shape().dims();
  std::vector<std::uint64_t> shape(dims.begin(), dims.end());
  if (p.layout == Layout::plain) return shape;
  std::rotate(shape.begin(), shape.end() - 2, shape.end());  // [k..., in, out] -> [in, out, k...]
  if (p.layout != Layout::conv_transpose) std::swap(shape[0], shape[1]);
  if (p.layout == Layout::pointwise) shape.insert(shape.end(), {1, 1});
  return shape;
}

// Calls f(memory offset, file offset) for every element, file offsets ascending. Memory is [taps, in, out].
template <class F>
void for_each_element(const Parameter& p, F f) {
  const bool plain = p.layout == Layout::plain, input_first = p.layout == Layout::conv_transpose;
  const int rank = p.value.rank();
  const Dim in = plain ? 1 : p.value.dim(rank - 2), out = plain ? p.value.size() : p.value.dim(rank - 1);
  const Dim taps = in * out == 0 ? 0 : p.value.size() / (in * out);
  Dim at = 0;
  for (Dim a = 0; a < (input_first ? in : out); ++a) {
    for (Dim b = 0; b < (input_first ? out : in); ++b) {
      const Dim i = input_first ? a : b, o = input_first ? b : a;
      for (Dim k = 0; k < taps; ++k) f((k * in + i) * out + o, at++);
    }
  }
}

// Empty when the tensor in the file is what the parameter needs, else what is wrong with it.
std::string mismatch(const SafetensorsFile& file, const std::string& name, const Parameter& p) {
  const auto found = file.tensors().find(name);
  if (found == file.tensors().end()) return "missing " + name;
  const TensorInfo& info = found->second;
  if (info.dtype == "F32" && info.shape == file_shape(p)) return {};
  return name + " expected F32 " + shape_text(file_shape(p)) + ", found " + info.dtype + " " +
         shape_text(info.shape);
}

Tensor to_memory(const std::vector<float>& values, const Parameter& p) {
  Tensor t(p.value.shape());
  for_each_element(p, [&](Dim memory, Dim at) {
    t.data()[memory] = static_cast<real>(values[static_cast<std::size_t>(at)]);
  });
  return t;
}

}  // namespace

StoredTensor to_stored(const Parameter& p, const Tensor& tensor, const std::string& name) {
  StoredTensor stored{name, file_shape(p), std::vector<float>(static_cast<std::size_t>(tensor.size()))};
  for_each_element(p, [&](Dim memory, Dim at) {
    stored.values[static_cast<std::size_t>(at)] = static_cast<float>(tensor.data()[memory]);
  });
  return stored;
}

StoredTensor to_stored(const Parameter& p) { return to_stored(p, p.value.value(), p.name); }

void write_checkpoint(const OutputPath& output, const std::vector<Parameter>& parameters,
                      std::map<std::string, std::string> metadata, const std::vector<StoredTensor>& more) {
  metadata["format"] = "supertac-checkpoint";
  metadata["format_version"] = std::to_string(kCheckpointVersion);
  std::vector<StoredTensor> stored;
  for (const Parameter& p : parameters) stored.push_back(to_stored(p));
  stored.insert(stored.end(), more.begin(), more.end());
  std::vector<TensorToWrite> list;
  for (const StoredTensor& s : stored) {
    if (!std::ranges::all_of(s.values, [](float v) { return std::isfinite(v); }))
      throw FileError(output.path, "not written: " + s.name +
                                       " holds values that are not finite; the training "
                                       "diverged, lower its learning rate");
    list.push_back({s.name, "F32", s.shape, std::as_bytes(std::span(s.values))});
  }
  write_safetensors(output, std::move(metadata), list);
}

void check_checkpoint(const SafetensorsFile& file) {
  const std::string& path = file.path();
  const auto format = file.metadata().find("format");
  if (format == file.metadata().end() || format->second != "supertac-checkpoint") {
    throw std::runtime_error(path + ": not a SuperTac checkpoint: metadata \"format\" is " +
                             (format == file.metadata().end() ? "missing" : "\"" + format->second + "\"") +
                             "; give a file that supertac-train wrote");
  }
  const std::string text = value_or(file.metadata(), "format_version");
  const auto number = parse_int(text);
  if (!number || *number < 1 || *number > kCheckpointVersion) {
    throw std::runtime_error(path + ": checkpoint version \"" + text + "\", this program reads 1 to " +
                             std::to_string(kCheckpointVersion) + "; use a newer SuperTac");
  }
}

void load_parameters(const SafetensorsFile& file, const std::vector<Parameter>& parameters,
                     std::initializer_list<std::string_view> beside) {
  std::vector<std::string> problems;
  std::set<std::string> known;
  for (const Parameter& p : parameters) {
    known.insert(p.name);
    if (std::string problem = mismatch(file, p.name, p); !problem.empty())
      problems.push_back(std::move(problem));
  }
  for (const auto& entry : file.tensors()) {
    const std::string& name = entry.first;  // a lambda of Clang 14 captures no structured binding
    const auto begins = [&](std::string_view prefix) { return name.starts_with(prefix); };
    if (!known.contains(name) && std::ranges::none_of(beside, begins))
      problems.push_back("unexpected " + name);
  }
  if (!problems.empty()) {
    throw std::runtime_error(
        file.path() +
        ": the tensors do not fit the model that its metadata describes: " + joined(problems, "; "));
  }
  for (const Parameter& p : parameters) {
    Variable handle = p.value;
    const Tensor values = to_memory(file.f32(p.name), p);
    std::copy_n(values.data(), values.size(), handle.mutable_value().data());
  }
}

Tensor load_like(const SafetensorsFile& file, const std::string& name, const Parameter& parameter) {
  if (std::string problem = mismatch(file, name, parameter); !problem.empty())
    throw std::runtime_error(file.path() + ": " + problem);
  return to_memory(file.f32(name), parameter);
}

}  // namespace supertac
