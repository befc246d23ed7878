#include "data/windows/track_file.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>

#include "data/plates/plate_file.h"
#include "data/windows/chosen_plates.h"
#include "io/files/file.h"
#include "io/files/folder_lock.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPlaceNumbers = 3;
// Processes of one training start at the same time; one makes what all of them read. That takes minutes even
// for a hundred million frames: who holds the folder for an hour is stuck.
constexpr std::chrono::hours kLongestMaking{1};

std::string kept_in(const std::string& folder) { return (fs::path(folder) / ".supertac").string(); }

std::string base_of(const std::string& folder, const TrackFileSettings& settings) {
  Hash key;
  key.add(format(settings.rate_hz));
  key.add(format(settings.max_gap_s));
  for (const std::string& plate : settings.plates) key.add(plate);
  return kept_in(folder) + "/tracks-" + key.hex();
}

// Reads recordings one after the other, writes their tracks, and keeps what the index says.
class Maker {
 public:
  Maker(const std::string& folder, const TrackFileSettings& settings, const std::string& path)
      : folder_(folder), settings_(settings), chosen_(settings.plates), data_(path) {}

  void add(const std::string& name) {
    const SafetensorsFile file = SafetensorsFile::read((fs::path(folder_) / name).string());
    const Recording recording = recording_of(file);
    if (!chosen_.take(recording.plate)) return;
    if (index_.cards.empty()) index_.array = recording.array;
    if (recording.array != index_.array)
      throw std::runtime_error(file.path() + ": was recorded with " + recording.array.text() + ", expected " +
                               index_.array.text() +
                               "; give recordings of the array the model is for, and no others");
    const Track track =
        resample(recording, {.rate_hz = settings_.rate_hz, .max_gap_s = settings_.max_gap_s, .scaling = {}});
    hashes_.push_back(content_hash(file));
    index_.range.add(recording);
    index_.cards.push_back(card_of(recording, track, plate(recording.plate)));
    write(track);
  }

  TrackIndex end(std::vector<ListedFile> sources) {
    chosen_.check(folder_);
    data_.commit();
    index_.sources = std::move(sources);
    index_.content = hash_of_contents(std::move(hashes_));
    return std::move(index_);
  }

 private:
  const Plate& plate(const std::string& name) {
    const auto found = plates_.find(name);
    return found != plates_.end() ? found->second
                                  : plates_.emplace(name, plate_in_folder(name, folder_)).first->second;
  }

  void write(const Track& track) {
    std::vector<float> places;
    for (std::size_t i = 0; i < track.frames(); ++i)
      places.insert(places.end(), {track.position_mm[2 * i], track.position_mm[2 * i + 1], track.lift_mm[i]});
    data_.write(std::as_bytes(std::span(track.samples)));
    data_.write(std::as_bytes(std::span(places)));
  }

  const std::string& folder_;
  const TrackFileSettings& settings_;
  ChosenPlates chosen_;
  std::map<std::string, Plate> plates_;
  std::vector<std::string> hashes_;
  TrackIndex index_;
  AtomicFile data_;
};

TrackIndex make(const std::string& folder, const std::string& base, const TrackFileSettings& settings,
                std::vector<ListedFile> sources) {
  Maker maker(folder, settings, base + ".f32");
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (settings.watch) settings.watch(i, sources.size());
    if (!Plate::is_file(sources[i].name)) maker.add(sources[i].name);
  }
  TrackIndex index = maker.end(std::move(sources));
  write_index(base, index);
  return index;
}

}  // namespace

std::shared_ptr<const TrackFile> TrackFile::open(const std::string& folder,
                                                 const TrackFileSettings& settings) {
  const std::string base = base_of(folder, settings);
  std::vector<ListedFile> sources = list_sources(folder);
  std::optional<TrackIndex> index = read_index(base, sources);
  if (!index) {
    make_directories(kept_in(folder));
    const FolderLock lock = lock_within(kLongestMaking, kept_in(folder), [&] {
      if (settings.watch) settings.watch(0, sources.size());
    });
    index = read_index(base, sources);
    if (!index) index = make(folder, base, settings, std::move(sources));
  }
  return std::shared_ptr<const TrackFile>(new TrackFile(folder, base, std::move(*index), settings.memory));
}

TrackFile::TrackFile(std::string folder, const std::string& base, TrackIndex index, std::uint64_t memory)
    : folder_(std::move(folder)), index_(std::move(index)), file_(base + ".f32") {
  std::uint64_t end = 0;
  for (const TrackCard& card : index_.cards) {
    offsets_.push_back(end);
    end += card.frames * (index_.array.signals() + kPlaceNumbers) * sizeof(float);
  }
  Hash identity;
  identity.add(base.substr(base.rfind('/')));
  for (const ListedFile& source : index_.sources) {
    identity.add(source.name);
    identity.add(source.size);
    identity.add(source.time);
  }
  identity_ = identity.hex();
  head_.resize(std::min(memory, end));
  file_.read(0, head_);
}

void TrackFile::read(std::uint64_t offset, std::span<float> out) const {
  const auto bytes = std::as_writable_bytes(out);
  if (offset + bytes.size() <= head_.size())
    std::memcpy(bytes.data(), head_.data() + offset, bytes.size());
  else
    file_.read(offset, bytes);
}

std::uint64_t TrackFile::offset_of_volts(std::size_t card, std::size_t frame) const {
  return offsets_[card] + frame * index_.array.signals() * sizeof(float);
}

std::uint64_t TrackFile::offset_of_place(std::size_t card, std::size_t frame) const {
  return offset_of_volts(card, index_.cards[card].frames) + kPlaceNumbers * frame * sizeof(float);
}

void TrackFile::volts(std::size_t card, std::size_t first, std::span<float> out) const {
  read(offset_of_volts(card, first), out);
}

std::array<float, 3> TrackFile::place(std::size_t card, std::size_t frame) const {
  std::array<float, kPlaceNumbers> place{};
  read(offset_of_place(card, frame), place);
  return place;
}

void TrackFile::will_read(std::size_t card, std::size_t first, std::size_t count) const {
  const std::uint64_t begin = offset_of_volts(card, first), end = offset_of_volts(card, first + count);
  if (end > head_.size()) file_.will_read(begin, end - begin);
  const std::uint64_t place = offset_of_place(card, first + count - 1), size = kPlaceNumbers * sizeof(float);
  if (place + size > head_.size()) file_.will_read(place, size);
}

Track TrackFile::track(std::size_t card) const {
  const std::size_t frames = index_.cards[card].frames, signals = index_.array.signals();
  std::vector<float> values(frames * (signals + kPlaceNumbers));
  read(offsets_[card], values);
  Track track;
  for (std::size_t i = frames * signals; i < values.size(); i += kPlaceNumbers) {
    track.position_mm.insert(track.position_mm.end(), {values[i], values[i + 1]});
    track.lift_mm.push_back(values[i + 2]);
  }
  values.resize(frames * signals);
  track.samples = std::move(values);
  return track;
}

std::string TrackFile::recall(const std::string& key, const std::function<std::string()>& compute) const {
  const std::string path = kept_in(folder_) + "/notes.json", entry = identity_ + " " + key;
  constexpr std::uint64_t kMostBytes = 1 << 20;
  const auto read_notes = [&] {
    try {
      return parse_json_limited(read_text_file(path, kMostBytes));
    } catch (const std::exception&) {
      return nlohmann::ordered_json::object();  // none yet, or none that can be read
    }
  };
  auto notes = read_notes();
  if (notes.contains(entry) && notes[entry].is_string()) return notes[entry].get<std::string>();
  std::string value = compute();
  try {
    const FolderLock lock = lock_within(kLongestMaking, kept_in(folder_));
    notes = read_notes();
    notes[entry] = value;
    write_file(path, notes.dump(1) + "\n");
  } catch (const FileError&) {  // it is computed again the next time
  }
  return value;
}

}  // namespace supertac
