// The index of a TrackFile: all that is to be known of its tracks but the tracks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "data/recordings/signal_range.h"
#include "data/windows/track_card.h"

namespace supertac {

/// A file that tracks were made of, as it was then.
struct ListedFile {
  std::string name;
  std::uint64_t size = 0;
  std::int64_t time = 0;
  bool operator==(const ListedFile&) const = default;
};

/// Of one file. Throws FileError.
ListedFile listed(const std::string& path);
/// The recordings and STL files of a folder in the order of their names. Throws as list_recordings().
std::vector<ListedFile> list_sources(const std::string& folder);

struct TrackIndex {
  std::vector<ListedFile> sources;
  TaxelArray array;
  std::string content;           ///< hash_of_recordings()
  std::vector<TrackCard> cards;  ///< in the order of the recordings' names
  SignalRange range;
};

/// `base`: index and data are this path with .safetensors and .f32. Throws FileError.
void write_index(const std::string& base, const TrackIndex& index);
/// Nothing when there is none, it is damaged, or it was made of other sources or for other data.
std::optional<TrackIndex> read_index(const std::string& base, const std::vector<ListedFile>& sources);

}  // namespace supertac
