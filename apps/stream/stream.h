// A live stream: the loop from frames to pictures, and to all who take them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "apps/common/running/progress.h"
#include "apps/stream/picture_log.h"
#include "apps/stream/picture_maker.h"
#include "apps/stream/pressed_order.h"
#include "apps/stream/raw_array.h"
#include "apps/stream/views/for_programs.h"
#include "apps/stream/views/web_view.h"
#include "data/map/named_map.h"

namespace supertac {

/// Quantiles of any number of durations in fixed memory: 64 classes for every doubling from 1 us to 71
/// minutes, so a quantile is right to 1.1 %.
class LatencyHistogram {
 public:
  void add(double seconds) {
    const double place = kPerDoubling * std::log2(std::max(1e6 * seconds, 1.0));
    ++classes_[static_cast<std::size_t>(std::min(place, classes_.size() - 1.0))];
    ++count_;
    max_ = std::max(max_, seconds);
  }
  std::uint64_t count() const { return count_; }
  /// The value that a share `q` of the durations does not exceed, in seconds; 0 without any.
  double quantile(double q) const {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < classes_.size(); ++i) {
      seen += classes_[i];
      if (classes_[i] > 0 && seen >= wanted)
        return std::min(max_, 1e-6 * std::exp2((static_cast<double>(i) + 1) / kPerDoubling));
    }
    return max_;
  }
  double max() const { return max_; }

 private:
  static constexpr int kPerDoubling = 64, kDoublings = 32;
  std::array<std::uint64_t, kPerDoubling * kDoublings> classes_{};
  std::uint64_t count_ = 0;
  double max_ = 0;
};

struct StreamSettings {
  double seconds = std::numeric_limits<double>::infinity();  ///< of signal, after which run() ends
  OutputPath out = "";  ///< file that keeps the pictures; "-": a line for each to stdout; empty: none
  Precision precision = Precision::fp32;
  OutputPath mcap = "";              ///< MCAP file that keeps frames and pictures; empty: none
  std::string record = {};           ///< folder that gets a recording; empty: none
  std::string plate = "unknown";     ///< of the recording: a plate's name or an STL file
  OutputPath map = "";               ///< file of the surface that was felt; empty: none
  std::vector<Plate> elements = {};  ///< kinds that the map's elements may be drawn as, where that is stated
  bool view = false;                 ///< show the figures on the terminal
  std::optional<WebAddress> web = {};   ///< serve the live page
  std::string badge = {}, source = {};  ///< for the page: what is streamed
  std::vector<std::string> found = {};  ///< for the page: what a probe of the source found, a line each
  std::optional<Sensor> draft = {};     ///< of that probe
  std::string draft_file = {};          ///< that holds it; empty: none
  std::map<std::string, std::string> metadata = {};  ///< of files with pictures
};

/// From a source's frames to pictures, on a page and in files, and figures on the terminal; counts what was
/// lost and how long a picture took. Without a model the array's own signals are what is shown and kept. A
/// picture of a live source that would be older than 20 ms is not made: where the machine is too slow, or was
/// busy, the newest count.
class Stream {
 public:
  /// `models`, of which there may be none, and `source` must outlive this. Throws as PictureMaker,
  /// PictureLog and WebServer.
  Stream(const StreamSettings& settings, std::span<const ModelFile> models, SensorSource& source);

  /// Until the source ends, `seconds` are over, or the program is interrupted. What is recorded passes as
  /// fast as it happened where somebody watches, else as fast as it can.
  void run();
  /// Writes the files, ends the source, and tells the page what became of the run: `failure`, or that it is
  /// done when that is empty.
  void finish(const std::string& failure = {});

  /// Shown; without a model frames.
  std::uint64_t pictures() const { return latency_.count(); }
  /// Of the live page; empty without.
  std::string url() const { return web_ ? web_->url() : std::string(); }
  /// Seconds of signal before the first picture.
  double window_s() const { return maker_ ? maker_->window_s() : 0; }
  /// Silences that no window crosses.
  std::uint64_t gaps() const { return maker_ ? maker_->window().gaps() : 0; }
  /// "; ..." where frames come more or less often than the source says, else empty.
  std::string rate_remark() const;
  /// A line for people, and the same for --json.
  std::string summary() const;
  nlohmann::ordered_json result() const;

 private:
  bool take(SensorFrame frame);
  double keep_pace(double time_s) const;
  void keep(const SensorFrame& frame, std::span<const float> picture);
  void keep_raw(const SensorFrame& frame);
  void output(const SensorFrame& frame, const LiveFrame& seen);
  void write_map() const;
  NamedMap named(MapCells cells) const;
  void complete();
  void describe_recording();
  void open_page(const PictureFormat& recorded, const PictureFormat& format);
  void show();
  double milliseconds(double quantile) const { return 1e3 * latency_.quantile(quantile); }
  std::uint64_t dropped() const { return too_late_ + source_.counters().dropped; }

  StreamSettings settings_;
  SensorSource& source_;
  std::unique_ptr<PictureMaker> maker_;  // nothing without a model
  RawArray raw_;
  std::map<std::string, std::string> recording_;  // metadata of a recording
  std::string record_path_, record_remark_;
  std::string about_lines_;
  std::unique_ptr<PictureLog> log_, record_;
  std::unique_ptr<McapLog> mcap_;
  std::unique_ptr<TerminalLine> view_;
  std::unique_ptr<PipeOutput> pipe_;
  std::unique_ptr<Recorder> recorder_;  // at the page's wish
  std::unique_ptr<PressedOrder> order_;
  std::unique_ptr<WebView> web_;
  struct Place {
    double time_s;
    float x_mm, y_mm, lift_mm;
  };
  std::deque<Place> places_;       // of the finger, since what the newest picture shows
  std::optional<SurfaceMap> map_;  // where somebody wants it
  MapRegion changed_;              // of it, since the page was told
  LatencyHistogram latency_;
  LiveState state_;
  std::uint64_t frames_ = 0, too_late_ = 0, unlike_ = 0, lines_lost_ = 0, figures_frames_ = 0;
  double first_s_ = 0, last_s_ = 0;  // the sensor's time
  double wall_offset_s_ = 0;         // from the sensor's time to the wall clock's
  double begin_s_ = 0, figures_s_ = 0, shown_s_ = 0;
};

}  // namespace supertac
