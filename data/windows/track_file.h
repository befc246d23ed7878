// Data larger than memory: the tracks of a folder's recordings in a file beside them.
//
//   FOLDER/.supertac/tracks-KEY.f32          per recording its samples in volts, then (x, y, lift) per frame
//   FOLDER/.supertac/tracks-KEY.safetensors  the index (track_index.h)
//   FOLDER/.supertac/notes.json              what was computed of such tracks
//
// KEY stands for rate, gap and plates. All can be deleted at any time, and are made again when needed.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/windows/track_index.h"
#include "io/files/positioned_file.h"

namespace supertac {

struct TrackFileSettings {
  std::vector<std::string> plates = {};  ///< only these; all when empty
  double rate_hz = 300, max_gap_s = 0.05;
  std::uint64_t memory = 0;  ///< so many bytes of the tracks are held in memory, the others are read
  ReadingWatch watch = {};   ///< of the recordings that are read to make the file, and while it waits
};

/// Gives what read_recording() and resample() make of the recordings, to the bit. Reading is const and safe
/// from many threads.
class TrackFile {
 public:
  /// Opens the file. It is made first when there is none, when a recording or STL file of the folder has
  /// come, gone, or got another size or time, or when the index fails its checksum. While another process
  /// makes it, this one waits, for an hour at most. Throws as list_recordings(), read_recording(),
  /// plate_in_folder() and ChosenPlates::check(); FileError when it cannot be written; std::runtime_error for
  /// recordings of different arrays.
  static std::shared_ptr<const TrackFile> open(const std::string& folder, const TrackFileSettings& settings);

  const std::string& folder() const { return folder_; }
  const TrackIndex& index() const { return index_; }

  // `card` is one of index().cards, and the frames are some of its frames: unchecked. Throw FileError when
  // the file was shortened, or on an I/O error.
  /// Samples from frame `first` on, [...][signals] in volts, as many as there is room for.
  void volts(std::size_t card, std::size_t first, std::span<float> out) const;
  /// (x, y, lift) of a frame.
  std::array<float, 3> place(std::size_t card, std::size_t frame) const;
  /// volts() of `count` frames from `first` on is called soon, and place() of the last of them.
  void will_read(std::size_t card, std::size_t first, std::size_t count) const;
  /// samples in volts, position_mm and lift_mm of all frames.
  Track track(std::size_t card) const;

  /// What `compute` returned when it was called for this key with these recordings before, or returns now.
  std::string recall(const std::string& key, const std::function<std::string()>& compute) const;

 private:
  TrackFile(std::string folder, const std::string& base, TrackIndex index, std::uint64_t memory);
  void read(std::uint64_t offset, std::span<float> out) const;
  std::uint64_t offset_of_volts(std::size_t card, std::size_t frame) const;
  std::uint64_t offset_of_place(std::size_t card, std::size_t frame) const;

  std::string folder_, identity_;
  TrackIndex index_;
  std::vector<std::uint64_t> offsets_;  // of the cards' samples, in bytes
  PositionedFile file_;
  std::vector<std::byte> head_;  // of the file: what is held in memory
};

}  // namespace supertac
