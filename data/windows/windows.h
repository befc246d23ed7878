// Recordings as examples for a network: windows of the last T samples, each with its truth.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/plates/truth.h"
#include "data/recordings/recording.h"
#include "data/recordings/resample.h"
#include "data/sensors/taxel_array.h"
#include "io/files/file.h"

namespace supertac {

struct WindowSettings {
  int timesteps = 256;                   ///< T, frames per window
  int scale = 4;                         ///< 2, 4, 8 or 16: truths that many times finer than the array
  double rate_hz = 300;                  ///< the model's rate
  double delay_s = 0;                    ///< by how much what a window shows is older than its last frame
  Scaling scaling = {};                  ///< signals to [0,1]
  std::optional<TaxelArray> array = {};  ///< that every recording must have; nothing: that of the first
  std::optional<SignalScale> signal_scale = {};  ///< likewise, its unit and polarity
  std::optional<Body> body = {};                 ///< of what is simulated beside them: that of the first
  std::optional<float> contact_level = {};       ///< of measured truths; nothing: as contact_level() finds it
  int stride = 1;                                ///< every stride-th frame of a pass ends a window
};

/// Where the frames of the recordings went: frames is the sum of all that follow down to windows.
struct WindowCounts {
  std::size_t recordings = 0, added = 0;  ///< files, and passes that training simulates beside them
  std::size_t frames = 0;                 ///< of both
  std::size_t unreliable = 0;   ///< of passes that registration flagged (metadata registration_reliable = no)
  std::size_t no_position = 0;  ///< position unknown: no truth
  std::size_t lifting = 0;      ///< between the plate and the air: what is felt there has no truth
  std::size_t too_early = 0;    ///< fewer than T frames since the pass began or since a gap
  std::size_t off_stride = 0;
  std::size_t windows = 0;
  // About the signals of all recordings:
  std::size_t held = 0, gaps = 0;  ///< as in Track
  /// One line, for people.
  std::string summary() const;
};

/// What the windows of a pass are for.
struct PassUse {
  bool training_only = false;  ///< no split tests them: simulated passes beside real ones
  /// Whether training may augment its windows. Each simulated pass has a finger of its own already, and
  /// changes would only blur it.
  bool augmentable = true;
  /// Whether its windows resemble those in use: the novelty alarm is fitted to these alone.
  bool in_distribution = true;
  int stride = 0;  ///< every stride-th frame ends a window; 0: that of the settings
};

/// The windows of a set of recordings. Nothing is copied per window: a recording is brought to rate_hz once,
/// scaled, and kept in a ScratchFile, so that data sets may be larger than memory. A window is a number, from
/// which pass and last frame follow, and none crosses the edge of a pass or a gap. T = 1: every recorded
/// frame is a window, as it is, whatever the rate. Memory: 24 bytes for each stretch of frames without a gap.
/// Reading is const and safe from many threads.
class WindowSet {
 public:
  struct Pass {
    std::string plate;
    int trial = 0, pass = 0;
    double speed_mm_s = 0;
    std::string source;
    std::string group;       ///< person, object, day (metadata "group"): what split group keeps together
    double filter_s = 0;     ///< length of the moving average the signals went through; 0 = none
    std::size_t frames = 0;  ///< on the model's rate
    std::size_t first_window = 0, windows = 0;  ///< its windows are consecutive, in order of time
    PassUse use;
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
  /// Appends the windows of one recording. `folder`: where the recording lies, for a plate that is an STL
  /// file beside it. Throws as plate_in_folder() and resample(), std::runtime_error for another array, unit
  /// or polarity, or a measured truth that is not scale() times as fine as the array; FileError as
  /// ScratchFile.
  void add(const Recording& recording, const std::string& folder = ".", const PassUse& use = {});

  std::size_t size() const { return counts_.windows; }
  std::size_t frames() const { return static_cast<std::size_t>(settings_.timesteps); }
  /// Of the recordings; the rig's while there is none.
  TaxelArray array() const { return settings_.array.value_or(TaxelArray{}); }
  SignalScale signal_scale() const { return settings_.signal_scale.value_or(SignalScale{}); }
  int scale() const { return settings_.scale; }
  std::size_t input_size() const { return frames() * array().signals(); }
  /// Of delay_s.
  std::size_t delay_frames() const {
    return static_cast<std::size_t>(std::lround(settings_.delay_s * settings_.rate_hz));
  }
  ImageGrid image() const { return array().picture(scale()); }
  const WindowSettings& settings() const { return settings_; }
  const WindowCounts& counts() const { return counts_; }
  const std::vector<Pass>& passes() const { return passes_; }
  /// Under the finger of a pass; a plain one where the truth was measured.
  const Plate& plate(std::size_t pass) const { return plates_[stored_[pass].plate].plate; }

  // i < size() throughout, unchecked: these run for every sample of training.
  // Throws std::invalid_argument when `out` has another size; FileError as ScratchFile.
  /// Window i as a network takes it, [T][signals], oldest frame first; normalised when the scaling says so.
  void window(std::size_t i, std::span<float> out) const;
  /// The window, not normalised.
  std::vector<float> raw_window(std::size_t i) const;
  /// Writes the truth [height][width] of image() of the frame that the window shows: of its last frame, or of
  /// an earlier one where pictures are delayed. It is the measured one or truth_image(), and 0 in the air.
  void truth(std::size_t i, std::span<float> out) const;
  /// The signals of that frame.
  std::vector<float> shown_frame(std::size_t i) const;
  /// The finger's centre on the plate in that frame; NaN where it is unknown.
  Position position(std::size_t i) const;
  /// "x 18.0, y 43.5 mm", or where that is unknown "frame 17".
  std::string place_text(std::size_t i) const;
  /// Windows of one zone are scored together. Where the truth was measured, a window is in contact if it goes
  /// beyond contact_level(), else flat.
  Zone zone(std::size_t i) const;
  bool augmentable(std::size_t i) const { return passes_[pass_of(i)].use.augmentable; }
  bool in_distribution(std::size_t i) const { return passes_[pass_of(i)].use.in_distribution; }
  bool contact(std::size_t i) const { return zone(i) == Zone::contact; }
  /// The level of a measured truth beyond which it is contact: that of the settings, or the median of the
  /// recordings'; nothing where no truth was measured.
  std::optional<float> contact_level() const;
  std::size_t pass_of(std::size_t i) const { return place_of(i).pass; }
  /// Number of the last frame within its pass.
  std::size_t frame_of(std::size_t i) const { return place_of(i).last; }
  /// Frames since its pass began or since the last gap, the last frame included: at least frames().
  std::size_t history(std::size_t i) const { return place_of(i).run; }
  bool truth_is_measured(std::size_t pass) const { return plates_[stored_[pass].plate].measured; }
  /// The filter_s of all passes but those that are not in_distribution, or nothing when they differ.
  std::optional<double> filter_s() const;

  /// 16 hexadecimal digits over samples, positions, plates and index: the same data and settings, the same
  /// text.
  std::string fingerprint() const;

 private:
  /// Windows that end at every stride-th frame.
  struct Row {
    std::uint32_t pass, last, run, stride;  // of the first of them
    std::size_t first_window;
  };
  struct Place {
    std::size_t pass, last, run;
  };
  struct Stored {  // of a pass: places in the file, and whose plate it is
    std::uint64_t samples = 0, fingers = 0, truths = 0;
    std::size_t plate = 0;  // in plates_
  };
  struct KnownPlate {
    Plate plate;
    bool measured;  // its recordings have truths of their own: nothing is known of its shape
  };
  std::string why_empty() const;
  void expect_array(const Recording& recording);
  void expect_unit(const SignalScale& found);
  std::size_t plate_index(const Recording& recording, const std::string& folder);
  void add_windows(const Track& track, std::size_t first, std::size_t end, std::uint32_t stride);
  void store(const Recording& recording, const Track& track, Stored& stored);
  Place place_of(std::size_t i) const;
  std::array<float, 3> finger(const Place& place) const;
  void read_samples(std::size_t i, std::size_t frames_back, std::span<float> out) const;

  WindowSettings settings_;
  WindowCounts counts_;
  std::vector<KnownPlate> plates_;
  std::vector<Pass> passes_;
  std::vector<Stored> stored_;  // per pass
  std::vector<Row> rows_;
  std::vector<float> contact_levels_;  // of the recordings with a measured truth
  std::shared_ptr<ScratchFile> file_;  // of copies too: all append to it
};

/// Remarks on these windows, for people: no signal changes, some never do (less than a fiftieth of
/// what the middle one does: dead taxels), a twentieth or more lie at the end of the scaling (saturated or
/// clipped), no truth shows anything. Looks at the signals of some thousand of them, evenly spread; nothing
/// when all is well.
std::vector<std::string> remarks_on(const WindowSet& windows, std::span<const std::uint32_t> chosen);

}  // namespace supertac
