// Parameters in safetensors files, in PyTorch's layouts and order of axes.
#pragma once

#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/safetensors.h"
#include "layers/module.h"

namespace supertac {

/// Version of the meaning of a checkpoint's tensors and metadata; a newer file is refused.
inline constexpr int kCheckpointVersion = 1;

/// A named array in a file's layout, ready to be written.
struct StoredTensor {
  std::string name;
  std::vector<std::uint64_t> shape;
  std::vector<float> values;
};

/// The parameter (or `tensor`, an array of the same shape and layout, e.g. a moment of Adam) as it is stored.
StoredTensor to_stored(const Parameter& parameter);
StoredTensor to_stored(const Parameter& parameter, const Tensor& tensor, const std::string& name);

/// Writes all parameters and `more` behind them, atomically. metadata gains "format" = "supertac-checkpoint"
/// and "format_version". Throws FileError, also for a value that is not finite.
void write_checkpoint(const OutputPath& output, const std::vector<Parameter>& parameters,
                      std::map<std::string, std::string> metadata,
                      const std::vector<StoredTensor>& more = {});

/// Throws std::runtime_error naming path, expected and found unless it is a checkpoint that this version
/// reads.
void check_checkpoint(const SafetensorsFile& file);

/// Fills the parameters from the file. Other tensors are allowed when their names begin with one of `beside`.
/// Throws std::runtime_error that lists every missing, unexpected and mismatching tensor at once; then
/// nothing has been changed.
void load_parameters(const SafetensorsFile& file, const std::vector<Parameter>& parameters,
                     std::initializer_list<std::string_view> beside = {});

/// Reads one array stored by to_stored() for that parameter into a tensor in the memory layout.
/// Throws std::runtime_error when it is missing or of another shape or type.
Tensor load_like(const SafetensorsFile& file, const std::string& name, const Parameter& parameter);

}  // namespace supertac
