#include "data/frames/sensor_decoder.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "data/frames/binary_decoder.h"
#include "data/frames/text_grammar.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

/// What stands at a key, or at a JSON Pointer (RFC 6901) such as "/finger/taxels". Throws where nothing does.
const nlohmann::ordered_json& at(const nlohmann::ordered_json& json, const std::string& key) {
  return key.starts_with('/') ? json.at(nlohmann::ordered_json::json_pointer(key)) : json.at(key);
}

/// Cuts the stream into lines of text or JSON; one that is too long to be a frame is thrown away as it comes.
class LineDecoder : public SensorDecoder {
 public:
  explicit LineDecoder(const Sensor& sensor)
      : format_(sensor.frame), count_(sensor.values()), lines_(sensor.frame) {
    std::ranges::sort(format_.skip);
    longest_ = 4096 + 64 * (count_ + format_.skip.size());  // names and marks, and what a number takes
  }

  void push(std::span<const std::byte> bytes, const Sink& sink) override {
    counters_.bytes += bytes.size();
    for (const std::byte byte : bytes) {
      if (byte != std::byte{'\n'}) {
        line_ += static_cast<char>(byte);
        if (line_.size() > longest_) overlong_ += line_.size(), line_.clear();
        continue;
      }
      const std::size_t size = line_.size() + overlong_;
      DecodedFrame frame;
      values_.clear();
      Line what = overlong_ > 0                     ? Line::torn
                  : format_.kind == FrameKind::json ? read_json(frame)
                                                    : read_text(frame);
      if (what == Line::frame && values_.size() != count_) what = Line::torn;
      pending_ = what == Line::nothing ? pending_ + size + 1 : what == Line::torn ? pending_ : 0;
      if (what == Line::frame) {
        ++counters_.frames;
        frame.values = values_;
        sink(frame);
      } else if (what == Line::torn && (overlong_ > 0 || !trimmed(line_).empty() || pending_ > 0)) {
        ++counters_.torn, counters_.discarded_bytes += size + 1 + pending_;
        pending_ = 0;
      }
      line_.clear(), overlong_ = 0;
    }
  }

 private:
  using Line = TextFrames::Result;
  // Of line_: they fill values_ and the frame's time.
  Line read_text(DecodedFrame& frame) {
    if (const Line result = lines_.push(clean_line(line_)); result != Line::frame) return result;
    const std::vector<TextSlot>& slots = lines_.slots();
    if (slots.size() != count_ + format_.skip.size() + (format_.time ? 1 : 0)) return Line::torn;
    for (std::size_t c = 0; c < slots.size(); ++c) {
      const int column = static_cast<int>(c);
      if (std::ranges::binary_search(format_.skip, column)) continue;
      if (slots[c].words) return Line::torn;
      if (format_.time && format_.time->column == column)
        frame.time_s = slots[c].value * format_.time->unit_s;
      else
        values_.push_back(static_cast<float>(slots[c].value));
    }
    return Line::frame;
  }
  Line read_json(DecodedFrame& frame) {
    const std::string clean = clean_line(line_);
    const std::string_view line = behind_stamp(clean);
    if (line.empty()) return Line::nothing;
    if (line.front() != '{' && line.front() != '[') return Line::torn;
    try {
      const auto json = parse_json_limited(line);
      if (format_.time) frame.time_s = at(json, format_.time->key).get<double>() * format_.time->unit_s;
      if (!flatten(format_.values.empty() ? json : at(json, format_.values), values_)) return Line::torn;
      for (auto place = format_.skip.rbegin(); place != format_.skip.rend(); ++place)
        if (*place < std::ssize(values_)) values_.erase(values_.begin() + *place);
      return Line::frame;
    } catch (const std::exception&) {  // of the parser, or a key that is missing or no number
      return Line::torn;
    }
  }

  FrameFormat format_;
  std::size_t count_, longest_, overlong_ = 0, pending_ = 0;  // pending_: bytes that may become a frame
  TextFrames lines_;
  std::string line_;
  std::vector<float> values_;
};

}  // namespace

bool flatten(const nlohmann::ordered_json& json, std::vector<float>& numbers) {
  if (json.is_number() || json.is_null()) {
    numbers.push_back(json.is_null() ? std::numeric_limits<float>::quiet_NaN() : json.get<float>());
    return true;
  }
  return json.is_array() && std::ranges::all_of(json, [&](const auto& e) { return flatten(e, numbers); });
}

std::unique_ptr<SensorDecoder> make_decoder(const Sensor& sensor) {
  if (sensor.frame.kind == FrameKind::binary) return std::make_unique<BinaryDecoder>(sensor);
  if (sensor.frame.kind != FrameKind::board) return std::make_unique<LineDecoder>(sensor);
  return std::make_unique<BoardDecoder>();
}

}  // namespace supertac
