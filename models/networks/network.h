// The interface of networks that draw pictures.
#pragma once

#include "autograd/trace.h"
#include "layers/module.h"

namespace supertac {

/// What a network is for: inputs of `frames` frames of rows x columns taxels with `channels` numbers each,
/// and pictures `scale` times finer than the array.
struct NetworkFormat {
  Dim frames = 1, rows = 4, columns = 4, channels = 1, scale = 4;
  bool operator==(const NetworkFormat&) const = default;
};

/// Pictures, with the predicted errors and latents of networks that have them.
struct Estimate {
  Tensor picture;          ///< [N,rows scale,columns scale,1]
  Tensor predicted_error;  ///< the same: how far from the truth a pixel is expected to be; undefined where
                           ///< nothing says so
  Tensor latents;          ///< [N,latents]; undefined for a network without any
};

/// The same on the graph.
struct Prediction {
  Variable picture, predicted_error, latents;
};

/// Networks take what WindowSet::window() gives, numbers in [0,1]. Their pictures have no bounds; trained on
/// plates they lie about in [-1,1], 0 being the plate's plane.
class Network : public Module {
 public:
  Network() = default;
  Network(const Network&) = default;
  Network(Network&&) = default;
  virtual ~Network() = default;

  virtual NetworkFormat format() const = 0;
  /// Of a batch of `count` inputs; likewise picture_shape().
  virtual Shape input_shape(Dim count) const = 0;
  Shape picture_shape(Dim count) const {
    const NetworkFormat f = format();
    return {count, f.rows * f.scale, f.columns * f.scale, 1};
  }
  /// Throws std::invalid_argument unless inputs have the input_shape() of some count.
  virtual Prediction draw(const Variable& inputs) const = 0;
  /// The same without recording. For many pictures use CompiledModel
  /// (models/inference/compiled/compiled_model.h), which is faster.
  Estimate estimate(const Tensor& inputs) const;
  /// The pictures alone, [N,rows scale,columns scale,1].
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }
};

inline Estimate Network::estimate(const Tensor& inputs) const {
  const NoGrad no_grad;
  const Prediction drawn = draw(Variable(inputs));
  const auto value = [](const Variable& x) { return x.defined() ? x.value() : Tensor(); };
  return {.picture = drawn.picture.value(),
          .predicted_error = value(drawn.predicted_error),
          .latents = value(drawn.latents)};
}

/// One inference on these inputs, unrecorded, and the ops that it ran. One of a thread at a time, as Trace.
struct TracedPrediction {
  TracedPrediction(const Network& network, const Tensor& inputs)
      : input(inputs), drawn(network.draw(input)) {}

  NoGrad no_grad;
  Trace trace;
  Variable input;
  Prediction drawn;
};

}  // namespace supertac
