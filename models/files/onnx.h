// A model as an ONNX file, for other runtimes.
#pragma once

#include <string>

#include "models/files/model_file.h"

namespace supertac {

/// The file's bytes. The model takes "volts" [N,T,signals] in the sensor's unit, each sample the mean of the
/// signals over a period of the model's rate; scaling and normalisation are part of the graph. It draws
/// "picture" [N,height,width] and, where the network has it, "predicted_error", the same shape,
/// of which interval.h makes 90 % intervals by `interval_factor` of the metadata. The file's metadata are
/// those of the model. The ops are those of one traced inference (autograd/trace.h). Throws
/// std::logic_error naming an op that has no counterpart.
std::string onnx_of(const ModelFile& model);

}  // namespace supertac
