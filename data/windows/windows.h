#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "data/recordings/resample.h"
#include "data/sensors/taxel_array.h"
#include "data/windows/examples.h"
#include "data/windows/track_file.h"

namespace supertac {

struct WindowSettings {
  int timesteps = 256;                   ///< T, frames per window
  int scale = 4;                         ///< 2, 4 or 8: truths that many times finer than the array
  double rate_hz = 300;                  ///< the model's rate
  Scaling scaling = {};                  ///< volts to [0,1]
  std::optional<TaxelArray> array = {};  ///< that every recording must have; nothing: that of the first
  std::optional<SignalScale> signal_scale = {};  ///< likewise, its unit and polarity
  int stride = 1;                                ///< every stride-th frame of a pass ends a window
  double max_gap_s = 0.05;                       ///< longer silence in a recording is a gap no window crosses
};

/// Where the frames of the recordings went: frames is the sum of all that follow down to windows.
struct WindowCounts {
  std::size_t recordings = 0, frames = 0;
  std::size_t unreliable = 0;   ///< of passes that registration flagged (metadata registration_reliable = no)
  std::size_t no_position = 0;  ///< position unknown: no truth
  std::size_t lifting = 0;      ///< between the plate and the air: what is felt there has no truth
  std::size_t too_early = 0;    ///< fewer than T frames since the pass began or since a gap
  std::size_t off_stride = 0;
  std::size_t windows = 0;
  // About the signals of all recordings:
  std::size_t held = 0, gaps = 0, damaged = 0;  ///< as in Track
  /// One line, for people.
  std::string summary() const;
};

/// The windows of a set of recordings. Nothing is copied per window: a recording is resampled once onto
/// rate_hz and kept as scaled floats, or read from a TrackFile each time, with the same bits. A window is a
/// number, from which pass and last frame follow, and none crosses the edge of a pass or a gap. Memory: 4
/// bytes per signal of a frame and 12 per frame, nothing of a TrackFile's. Reading is const and safe from
/// many threads.
class WindowSet : public Examples {
 public:
  struct Pass {
    std::string plate;
    int trial = 0, pass = 0;
    double speed_mm_s = 0;
    std::string source;
    double filter_s = 0;     ///< length of the moving average the signals went through; 0 = none
    std::size_t frames = 0;  ///< on the model's rate
    std::size_t first_window = 0, windows = 0;  ///< its windows are consecutive, in order of time
    bool aside = false;  ///< only ever trained on: no split tests it (simulated passes beside real ones)
    bool varied = true;  ///< may_vary() of its windows
    bool usual = true;   ///< usual() of its windows
  };
  struct Position {
    double x_mm = 0, y_mm = 0;
  };

  /// Reads the recordings of a directory, in the order of their names.
  /// `plates`: only these; all when empty.
  /// Throws std::invalid_argument on settings out of range or a plate without recordings,
  /// std::runtime_error when the directory holds no recording, a file is unreadable or of an unknown plate,
  /// or no window is left (saying where the frames went).
  static WindowSet load(const std::string& dir, const std::vector<std::string>& plates,
                        const WindowSettings& settings, const ReadingWatch& watch = {});

  /// An empty set, to be filled by add().
  /// Throws std::invalid_argument on settings out of range.
  explicit WindowSet(const WindowSettings& settings);
  /// Appends the windows of one recording. `folder`: where the recording lies, for a plate that is an
  /// STL file beside it. Throws as plate_in_folder() and resample(), std::runtime_error for another array.
  void add(const Recording& recording, const std::string& folder = ".", bool aside = false);
  /// The same for one of many passes that differ in everything: set aside, may_vary() is false, every
  /// stride-th frame ends a window. `usual`: usual() of its windows.
  void add_one_of_many(const Recording& recording, int stride, bool usual = true);
  /// Appends those of all recordings in a directory, of these plates (empty: all). Throws as load, but for
  /// the missing windows.
  void add_directory(const std::string& dir, const std::vector<std::string>& plates, bool aside = false,
                     const ReadingWatch& watch = {});
  /// The same of a file of tracks, which must have this set's rate_hz and max_gap_s.
  void add(std::shared_ptr<const TrackFile> file, bool aside = false);
  /// Throws std::runtime_error, saying where the frames of `dir` went, when there is no window.
  void check_any(const std::string& dir) const;

  std::size_t size() const override { return counts_.windows; }
  std::size_t frames() const override { return static_cast<std::size_t>(settings_.timesteps); }
  int timesteps() const { return settings_.timesteps; }
  /// Of the recordings; the rig's while there is none.
  TaxelArray array() const override { return settings_.array.value_or(TaxelArray{}); }
  SignalScale signal_scale() const { return settings_.signal_scale.value_or(SignalScale{}); }
  int scale() const override { return settings_.scale; }
  const WindowSettings& settings() const { return settings_; }
  const WindowCounts& counts() const { return counts_; }
  const std::vector<Pass>& passes() const { return passes_; }
  const Plate& plate(std::size_t pass) const { return plates_[plate_of_[pass]]; }

  // i < size() throughout, unchecked: these run for every sample of training.
  // Throws std::invalid_argument when `out` has another size; FileError as TrackFile.
  /// Window i as a network takes it, [T][signals], oldest frame first; levelled when the scaling says so.
  void window(std::size_t i, std::span<float> out) const;
  /// The window, not levelled.
  std::vector<float> window(std::size_t i) const;
  /// Truth of its last frame, [height][width] of image(), as truth_image; 0 in the air.
  void truth(std::size_t i, std::span<float> out) const;
  /// The last frame, [signals].
  std::vector<float> last_frame(std::size_t i) const;
  Position position(std::size_t i) const;
  Zone zone(std::size_t i) const override;
  bool may_vary(std::size_t i) const override { return passes_[pass_of(i)].varied; }
  bool usual(std::size_t i) const override { return passes_[pass_of(i)].usual; }
  bool contact(std::size_t i) const { return zone(i) == Zone::contact; }
  std::size_t pass_of(std::size_t i) const { return place_of(i).pass; }
  void input(std::size_t i, std::span<float> out) const override { window(i, out); }
  void target(std::size_t i, std::span<float> out) const override { truth(i, out); }
  void will_read(std::size_t i) const override;
  std::int64_t group(std::size_t i) const override { return static_cast<std::int64_t>(pass_of(i)); }
  /// Number of the last frame within its pass.
  std::size_t frame_of(std::size_t i) const { return place_of(i).last; }
  /// Frames since its pass began or since the last gap, the last frame included: at least timesteps().
  std::size_t history(std::size_t i) const { return place_of(i).run; }
  /// The frames of a whole pass, but for `run`; none when no window ends in it.
  Track track(std::size_t pass) const;

  /// hash_of_recordings() of a folder that was added as a TrackFile; nothing of any other.
  std::optional<std::string> content(const std::string& folder) const;
  /// The filter_s of all passes with windows, or nothing when they differ.
  std::optional<double> filter_s() const;

  /// 16 hexadecimal digits over samples, positions, plates and index: the same data and settings, the same
  /// text.
  std::string fingerprint() const override;
  /// What `compute` returns; when all windows are of one TrackFile, as its recall(), with `key` and the
  /// settings for its key.
  std::string recall(const std::string& key, const std::function<std::string()>& compute) const;

 private:
  /// Windows that end at every stride-th frame.
  struct Row {
    std::uint32_t pass, last, run, stride;  // of the first of them
    std::size_t first_window;
  };
  struct Place {
    std::size_t pass, last, run;
  };
  struct Source {
    Track track;                            // without `run`; empty for those of a file
    std::shared_ptr<const TrackFile> file;  // or nothing
    std::size_t card;
  };
  struct Use {
    bool aside, varied;
    int stride;
    bool usual = true;
  };
  void append(const Recording& recording, const std::string& folder, const Use& use);
  void expect_array(const TaxelArray& array);
  void expect_unit(const SignalScale& found);
  std::size_t plate_index(const std::string& name, const std::string& folder);
  void append(const TrackCard& card, std::size_t plate, const Use& use);
  void append(const TrackCard& card, const FrameRange& stretch, std::uint32_t stride);
  Place place_of(std::size_t i) const;
  void samples(std::size_t pass, std::size_t first, std::span<float> out) const;
  std::array<float, 3> finger(const Place& place) const;
  std::string compute_fingerprint() const;

  WindowSettings settings_;
  WindowCounts counts_;
  std::vector<Plate> plates_;
  std::vector<Pass> passes_;
  std::vector<Source> sources_;        // per pass
  std::vector<std::size_t> plate_of_;  // per pass, into plates_
  std::vector<Row> rows_;
};

}  // namespace supertac
