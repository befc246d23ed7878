#include "data/plates/stl.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

static_assert(std::endian::native == std::endian::little, "STL files are little-endian");

constexpr std::size_t kTitleBytes = 80, kHeadBytes = 84, kFacetBytes = 50;

bool usable(double coordinate) { return std::abs(coordinate) <= double{kMaxStlCoordinateMm}; }  // no NaN

std::vector<Triangle> parse_binary(std::span<const std::byte> bytes, const std::string& name) {
  std::vector<Triangle> triangles((bytes.size() - kHeadBytes) / kFacetBytes);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const std::byte* facet = bytes.data() + kHeadBytes + i * kFacetBytes;
    std::memcpy(&triangles[i], facet + 3 * sizeof(float), sizeof(Triangle));  // behind the normal
    for (const auto& corner : triangles[i]) {
      for (const float coordinate : corner) {
        if (usable(coordinate)) continue;
        throw FileError(name, "triangle " + std::to_string(i + 1) + " has the coordinate " +
                                  format(coordinate) +
                                  ", expected a number within +-1000000 mm; export the model again");
      }
    }
  }
  return triangles;
}

// Words of the text form, with the number of their line.
class Words {
 public:
  Words(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  /// The next word; empty at the end.
  std::string_view next() {
    for (; at_ < text_.size() && is_space(text_[at_]); ++at_)
      line_ += text_[at_] == '\n' || (text_[at_] == '\r' && text_.substr(at_ + 1, 1) != "\n");
    const std::size_t begin = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  void skip_line() { at_ = std::min(text_.find_first_of("\r\n", at_), text_.size()); }
  /// Whether the word comes anywhere behind this place.
  bool any_left(std::string_view word) {
    for (auto found = next(); !found.empty(); found = next())
      if (same(found, word)) return true;
    return false;
  }

  void expect(std::string_view word) {
    if (const auto found = next(); !same(found, word)) reject(std::string(word), found);
  }
  float coordinate() {
    const auto word = next();
    const auto number = parse_double(word.starts_with('+') ? word.substr(1) : word);
    if (!number || !usable(*number)) reject("a number within +-1000000 mm", word);
    return static_cast<float>(*number);
  }
  static bool same(std::string_view found, std::string_view word) {
    return std::ranges::equal(found, word, {}, lower);
  }
  [[noreturn]] void reject(const std::string& expected, std::string_view found) const {
    throw FileError(name_, "line " + std::to_string(line_) + ": expected " + expected + ", found " +
                               (found.empty() ? "the end of the file" : in_quotes(found)) +
                               "; the file is damaged or no STL, export it again");
  }

 private:
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0, line_ = 1;
};

// Behind the word "facet".
Triangle parse_facet(Words& words) {
  words.expect("normal");
  for (int i = 0; i < 3; ++i) words.next();  // some writers put nan here; nothing uses it
  words.expect("outer");
  words.expect("loop");
  Triangle triangle{};
  for (auto& corner : triangle) {
    words.expect("vertex");
    for (float& coordinate : corner) coordinate = words.coordinate();
  }
  words.expect("endloop");
  words.expect("endfacet");
  return triangle;
}

std::vector<Triangle> parse_text(std::string_view text, const std::string& name) {
  std::vector<Triangle> triangles;
  Words words(text, name);
  for (auto word = words.next(); !word.empty(); word = words.next()) {
    if (!Words::same(word, "solid")) {
      // Remarks of the exporter behind the last solid; but not a solid whose first word is damaged.
      if (triangles.empty() || words.any_left("facet")) words.reject("solid", word);
      break;
    }
    words.skip_line();  // the solid's name
    for (word = words.next(); Words::same(word, "facet"); word = words.next())
      triangles.push_back(parse_facet(words));
    if (!Words::same(word, "endsolid")) words.reject("facet or endsolid", word);
    words.skip_line();
  }
  return triangles;
}

}  // namespace

std::vector<Triangle> parse_stl(std::span<const std::byte> bytes, const std::string& name) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // byte-order mark
  std::uint32_t count = 0;
  if (bytes.size() >= kHeadBytes) std::memcpy(&count, bytes.data() + kTitleBytes, sizeof count);
  const std::uint64_t length = kHeadBytes + std::uint64_t{kFacetBytes} * count;
  std::vector<Triangle> triangles;
  if (bytes.size() >= kHeadBytes && length == bytes.size()) {
    triangles = parse_binary(bytes, name);
  } else if (Words::same(Words(text, name).next().substr(0, 5), "solid") &&
             text.find('\0') == std::string_view::npos) {
    triangles = parse_text(text, name);
  } else if (bytes.size() < kHeadBytes) {
    throw FileError(name, "has " + std::to_string(bytes.size()) +
                              " bytes, expected an STL file of 84 or more; export it again");
  } else {
    throw FileError(name, "announces " + std::to_string(count) + " triangles, expected " +
                              std::to_string(length) + " bytes, found " + std::to_string(bytes.size()) +
                              "; the file was cut off or is no STL");
  }
  if (triangles.empty()) throw FileError(name, "holds no triangle; export the model again");
  return triangles;
}

std::vector<Triangle> read_stl(const std::string& path) {
  return parse_stl(read_file(path, kMaxStlBytes), path);
}

std::vector<std::byte> stl_bytes(const std::vector<Triangle>& triangles, std::string_view title) {
  if (title.starts_with("solid"))
    throw std::invalid_argument("stl_bytes: the title begins with \"solid\", which marks a text file");
  const std::size_t size = kHeadBytes + kFacetBytes * triangles.size();
  if (size > kMaxStlBytes)
    throw std::invalid_argument("stl_bytes: " + std::to_string(triangles.size()) +
                                " triangles make a file of " + std::to_string(size) +
                                " bytes, expected at most " + std::to_string(kMaxStlBytes) +
                                "; try a coarser resolution");
  std::vector<std::byte> bytes(size);
  std::memcpy(bytes.data(), title.data(), std::min(title.size(), kTitleBytes));
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::memcpy(bytes.data() + kTitleBytes, &count, sizeof count);
  std::byte* facet = bytes.data() + kHeadBytes;
  for (const Triangle& triangle : triangles) {
    std::memcpy(facet + 3 * sizeof(float), &triangle, sizeof triangle);
    facet += kFacetBytes;
  }
  return bytes;
}

}  // namespace supertac
