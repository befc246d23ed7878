// A stream as a safetensors file: a recording of its signals, or its pictures.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "apps/stream/live_frame.h"
#include "io/files/safetensors.h"

namespace supertac {

/// Keeps the signals of a stream, or its pictures, for a safetensors file. Signals alone make a recording
/// (data/recordings/recording.h): time_s and signals. With pictures it has tensors time_s F64 [n], signals
/// (or volts) F32 [n,signals] and pictures F32 [n,height,width]; of a model that says how sure it is also
/// half_widths F32 [n,height,width], of its pixels' 90 % intervals, and distances F32 [n] from its training.
/// Metadata "began_s" is the wall-clock time of time_s 0 (s since 1970), where it is known. How many there
/// will be is not known before the end, and they do not fit into memory (1 MB/s): they wait in nameless
/// temporary files beside the final one. A recording of a board is dated at its end, by the clock that
/// collections have (data/clock/frame_clock.h); frames whose time is uncertain by more than kTrustedS,
/// because the host or the board stood still, are left out, and metadata left_out_frames counts them.
class PictureLog {
 public:
  /// Throws FileError when the file cannot be made there, or exists and is not to be replaced.
  PictureLog(OutputPath output, const PictureFormat& format);
  ~PictureLog();
  PictureLog(const PictureLog&) = delete;
  PictureLog& operator=(const PictureLog&) = delete;
  /// Throws FileError; where there is room for no more than writing what it has, write() still can.
  void add(const LiveFrame& seen);
  /// Writes the file, atomically. Throws FileError, again when add() has.
  void write(std::map<std::string, std::string> metadata);
  /// Frames that write() left out.
  std::uint64_t left_out() const { return left_out_; }
  /// Nothing was added, and write() makes no file.
  bool empty() const { return count_ == 0; }
  static constexpr double kTrustedS = 0.03;  ///< in which a finger of 10 mm/s goes 0.3 mm

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  using Spool = std::unique_ptr<std::FILE, Close>;

  Spool open_spool();
  void append(const Spool& spool, std::span<const std::byte> bytes);
  void check_room(const LiveFrame& next);
  void read_back(const Spool& spool, const ByteSink& sink);
  std::vector<double> dated_times();
  void read_rows(const Spool& spool, std::size_t row_bytes, const ByteSink& sink);
  [[noreturn]] void fail();

  OutputPath output_;
  PictureFormat format_;
  std::uint64_t count_ = 0, left_out_ = 0;
  std::uint64_t bytes_ = 0, checked_bytes_ = 0;  // in the temporary files
  double began_s_ = NAN;                         // LiveFrame::wall_s of LiveFrame::time_s 0
  double first_s_ = 0;                           // LiveFrame::time_s of the first
  std::vector<FrameArrival> arrivals_;           // of a recording of a board
  std::vector<bool> kept_;                       // of its frames
  std::string problem_;                          // of a write that failed: what was kept is not whole
  Spool times_, signals_, pictures_, half_widths_, distances_;
};

}  // namespace supertac
