#include "data/windows/track_index.h"

#include <algorithm>
#include <filesystem>
#include <span>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr char kKind[] = "tracks", kVersion[] = "1";
constexpr std::size_t kNumbers = 10, kTexts = 2, kStretchNumbers = 4;

ListedFile listed(const fs::directory_entry& entry) {
  std::error_code error;
  ListedFile file{entry.path().filename().string(), entry.file_size(error), 0};
  if (!error) file.time = entry.last_write_time(error).time_since_epoch().count();
  if (error) throw FileError(entry.path().string(), "cannot look at the file: " + error.message());
  return file;
}

// One string after the other, each ended by a NUL.
class Texts {
 public:
  Texts() = default;
  explicit Texts(std::span<const std::byte> bytes)
      : bytes_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}
  void add(const std::string& text) { bytes_.append(text).push_back('\0'); }
  /// Throws std::out_of_range behind the last.
  std::string next() {
    const std::size_t end = bytes_.find('\0', at_);
    const std::string text = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return end == std::string::npos ? throw std::out_of_range("texts") : text;
  }
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(bytes_)); }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

void add(Texts& texts, const ListedFile& file) {
  texts.add(file.name);
  texts.add(std::to_string(file.size));
  texts.add(std::to_string(file.time));
}

ListedFile next_file(Texts& texts) {
  ListedFile file{texts.next()};
  file.size = parse_uint(texts.next()).value();
  file.time = parse_int(texts.next()).value();
  return file;
}

std::string text_of(const TaxelArray& a) {
  return nlohmann::ordered_json{a.rows, a.columns, a.pitch_mm, a.channels}.dump();
}

TaxelArray array_of(const std::string& text) {
  const auto json = parse_json_limited(text);
  return {json.at(0).get<int>(), json.at(1).get<int>(), json.at(2).get<double>(), json.at(3).get<int>()};
}

void add(std::vector<double>& numbers, std::initializer_list<double> more) {
  numbers.insert(numbers.end(), more);
}

std::vector<TrackCard> cards_of(Texts& texts, const SafetensorsFile& file) {
  const std::vector<double> numbers = file.f64("cards"), stretches = file.f64("stretches");
  std::vector<TrackCard> cards(numbers.size() / kNumbers);
  const auto count = [](double number) { return static_cast<std::size_t>(number); };
  const auto small = [](double number) { return static_cast<std::uint32_t>(number); };
  auto stretch = stretches.begin();
  for (std::size_t i = 0; i < cards.size(); ++i) {
    const auto n = std::span(numbers).subspan(i * kNumbers, kNumbers);
    TrackCard& card = cards[i];
    card.plate = texts.next(), card.source = texts.next();
    card.trial = static_cast<int>(n[0]), card.pass = static_cast<int>(n[1]), card.reliable = n[2] != 0;
    card.speed_mm_s = n[3], card.filter_s = n[4];
    card.frames = count(n[5]), card.held = count(n[6]), card.gaps = count(n[7]), card.damaged = count(n[8]);
    card.stretches.resize(count(n[9]));
    for (FrameRange& s : card.stretches) {
      s = {small(stretch[0]), small(stretch[1]), small(stretch[2]), small(stretch[3])};
      stretch += kStretchNumbers;
    }
  }
  return cards;
}

}  // namespace

ListedFile listed(const std::string& path) { return listed(fs::directory_entry(path)); }

std::vector<ListedFile> list_sources(const std::string& folder) {
  std::vector<ListedFile> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (entry->path().extension() == ".safetensors" || Plate::is_file(entry->path().filename().string()))
      files.push_back(listed(*entry));
  if (std::ranges::all_of(files, [](const ListedFile& file) { return Plate::is_file(file.name); }))
    list_recordings(folder);  // says what is wrong
  std::ranges::sort(files, {}, &ListedFile::name);
  return files;
}

void write_index(const std::string& base, const TrackIndex& index) {
  Texts texts;
  std::vector<double> numbers, stretches;
  add(texts, listed(base + ".f32"));
  for (const ListedFile& source : index.sources) add(texts, source);
  for (const TrackCard& c : index.cards) {
    texts.add(c.plate);
    texts.add(c.source);
    const auto number = [](auto count) { return static_cast<double>(count); };
    add(numbers,
        {number(c.trial), number(c.pass), c.reliable ? 1.0 : 0.0, c.speed_mm_s, c.filter_s, number(c.frames),
         number(c.held), number(c.gaps), number(c.damaged), number(c.stretches.size())});
    for (const FrameRange& s : c.stretches)
      add(stretches, {number(s.kind), number(s.first), number(s.frames), number(s.run)});
  }
  const std::vector<float>& range = index.range.values();
  write_safetensors(base + ".safetensors",
                    {{"kind", kKind},
                     {"tracks_version", kVersion},
                     {"array", text_of(index.array)},
                     {"content", index.content},
                     {"sources", std::to_string(index.sources.size())}},
                    {{"texts", "U8", {texts.bytes().size()}, texts.bytes()},
                     {"cards", "F64", {index.cards.size(), kNumbers}, std::as_bytes(std::span(numbers))},
                     {"stretches",
                      "F64",
                      {stretches.size() / kStretchNumbers, kStretchNumbers},
                      std::as_bytes(std::span(stretches))},
                     {"range", "F32", {range.size()}, std::as_bytes(std::span(range))}});
}

std::optional<TrackIndex> read_index(const std::string& base, const std::vector<ListedFile>& sources) {
  try {
    const SafetensorsFile file = SafetensorsFile::read(base + ".safetensors");
    const auto& metadata = file.metadata();
    if (metadata.at("kind") != kKind || metadata.at("tracks_version") != kVersion ||
        file.checksum() != SafetensorsFile::ChecksumState::ok ||
        metadata.at("sources") != std::to_string(sources.size()))
      return std::nullopt;
    Texts texts(file.bytes("texts"));
    if (next_file(texts) != listed(base + ".f32")) return std::nullopt;
    TrackIndex index;
    for (std::size_t i = 0; i < sources.size(); ++i) {
      index.sources.push_back(next_file(texts));
      if (index.sources.back() != sources[i]) return std::nullopt;
    }
    index.array = array_of(metadata.at("array"));
    index.content = metadata.at("content");
    index.cards = cards_of(texts, file);
    index.range = SignalRange(file.f32("range"));
    return index;
  } catch (const std::exception&) {
    return std::nullopt;  // it can be made again, whatever is wrong with it
  }
}

}  // namespace supertac
