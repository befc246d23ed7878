#include "models/frame_file.h"

#include <stdexcept>

#include "models/json_entry.h"

namespace supertac {
namespace {

FrameSettings read_settings(const JsonEntry& entry) {
  FrameSettings s;
  s.in_channels = entry.integer("in_channels");
  s.height = entry.integer("height");
  s.width = entry.integer("width");
  s.scale = entry.integer("scale");
  s.channels = entry.integer("channels");
  s.rcabs = entry.integer("rcabs");
  try {
    s.check();
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(entry.where() + ": " + error.what());
  }
  return s;
}

}  // namespace

std::map<std::string, std::string> frame_metadata(const FrameSettings& s, const ChannelScaling& scaling) {
  using Json = nlohmann::ordered_json;
  const Json settings = {
      {"in_channels", s.in_channels}, {"height", s.height}, {"width", s.width}, {"scale", s.scale},
      {"channels", s.channels},       {"rcabs", s.rcabs}};
  const Json input = {{"mean", scaling.mean}, {"factor", scaling.factor}, {"formula", "(x - mean) * factor"}};
  return {{"kind", kFrameKind}, {"settings", settings.dump()}, {"input", input.dump()}};
}

FrameFile load_frame_model(const std::string& path) {
  const SafetensorsFile file = read_checkpoint(path);
  const auto kind = file.metadata().find("kind");
  if (kind == file.metadata().end() || kind->second != kFrameKind)
    throw std::runtime_error(path + ": expected a frame model (trained with --pairs), found " +
                             (kind == file.metadata().end() ? "a SuperTac model; give it recordings"
                                                            : "kind \"" + kind->second + "\""));
  const FrameSettings settings = read_settings({file, path, "settings"});
  const JsonEntry input(file, path, "input");
  const auto channels = static_cast<std::size_t>(settings.in_channels);
  FrameFile loaded{
      nullptr, {input.numbers("mean", channels), input.numbers("factor", channels)}, file.metadata()};
  Rng rng(0);
  loaded.model = std::make_unique<FrameModel>(settings, rng);
  load_parameters(file, path, loaded.model->parameters());
  return loaded;
}

void save_frame_model(const std::string& path, const FrameModel& model, const ChannelScaling& scaling,
                      std::map<std::string, std::string> metadata) {
  metadata.merge(frame_metadata(model.settings(), scaling));
  write_checkpoint(path, model.parameters(), std::move(metadata));
}

}  // namespace supertac
