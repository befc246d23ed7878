// A frame model on disk: a checkpoint of kind "frame-checkpoint", so that nobody takes it for a SuperTac.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "data/samples/pairs.h"
#include "layers/checkpoint.h"
#include "models/frame_model.h"

namespace supertac {

inline constexpr const char* kFrameKind = "frame-checkpoint";

/// The metadata keys "kind", "settings" and "input" (mean and factor of every channel), JSON texts.
std::map<std::string, std::string> frame_metadata(const FrameSettings& settings,
                                                  const ChannelScaling& scaling);

struct FrameFile {
  std::unique_ptr<FrameModel> model;
  ChannelScaling scaling;
  std::map<std::string, std::string> metadata;
};

/// Builds the model that the metadata describes, after checking every setting's range, and fills it.
/// Throws std::runtime_error naming path, what was expected and found; so for a SuperTac model.
FrameFile load_frame_model(const std::string& path);

/// Writes parameters and metadata. Throws FileError.
void save_frame_model(const std::string& path, const FrameModel& model, const ChannelScaling& scaling,
                      std::map<std::string, std::string> metadata);

}  // namespace supertac
