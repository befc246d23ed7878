// What a texture classifier is shown of a window: the comparison of Figure 11 is one between views.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "data/windows/windows.h"
#include "models/networks/supertac_model.h"

namespace supertac {

enum class ViewKind {
  frame,    ///< the last frame as the network sees it: rows x columns, normalised when its windows are
  bicubic,  ///< the same enlarged to the picture's size, so that only its content differs from a picture
  super_resolved,  ///< the network's picture
  latents,         ///< the means of the latent distributions
  history,         ///< the last `frames` frames of all taxels, averaged to 16 steps: time without a network
  truth,           ///< the plate itself: what a perfect picture would allow
};

struct View {
  ViewKind kind = ViewKind::frame;
  int frames = 0;  ///< of a history, a multiple of 16

  /// "frame", "history32", ...
  std::string name() const;
  /// The view of that name. Throws std::invalid_argument that lists the names.
  static View named(const std::string& name);
};

/// Shows windows [N,T,signals] (the indices' ones, changed by augmentation perhaps) of a data set.
/// Pictures are [N,H,W,1], latents [N,G LD], frames [N,rows,columns,channels], or [N,signals] when an array
/// with less than four rows or columns makes no picture. A history is a "picture" of 16 steps x signals.
/// Throws std::invalid_argument when a history is longer than the windows.
Tensor show(const View& view, const SuperTac& model, const WindowSet& data,
            std::span<const std::uint32_t> indices, const Tensor& windows);

}  // namespace supertac
