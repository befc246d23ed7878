#include "data/plates/stl.h"

#include <cctype>
#include <ctime>

#include "io/files/file.h"
#include "tests/fuzz/corpus.h"
#include "tests/fuzz/stl_properties.h"
#include "tests/support/test.h"

namespace supertac::stl_test {

using Bytes = std::vector<std::byte>;

const std::vector<Triangle>& two_triangles() {
  static const std::vector<Triangle> kTriangles = {{{{0, 0, 0}, {2, 0, 0}, {0, 3, 0}}},
                                                   {{{1.5F, -2.25F, 4}, {0, 1e-3F, 7}, {5, 5, 5}}}};
  return kTriangles;
}

Bytes bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::string text_stl() {
  return "solid a name of words\n"
         " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 2 0 +0.0\n   vertex 0 3e0 0\n"
         "  endloop\n endfacet\n"
         "facet NORMAL nan nan nan outer loop vertex 1.5 -2.25 4 vertex 0 1E-3 7 vertex 5 5 5 endloop "
         "endfacet\r\n"
         "endsolid a name of words\n";
}

void expect_refused(const Bytes& bytes, const std::string& expected) {
  SCOPED_TRACE("expected: " + expected);
  EXPECT_ERROR(parse_stl(bytes, "plate.stl"), FileError, expected);
  EXPECT_ERROR(parse_stl(bytes, "plate.stl"), FileError, "plate.stl: ");
}

TEST(Stl, BinaryComesBackExactly) {
  const Bytes bytes = stl_bytes(two_triangles(), "two triangles");
  EXPECT_EQ(bytes.size(), 84u + 2 * 50);
  EXPECT_EQ(parse_stl(bytes, "plate.stl"), two_triangles());
}

TEST(Stl, TextIsReadWhateverItsSpacesAndCase) {
  EXPECT_EQ(parse_stl(bytes_of(text_stl()), "plate.stl"), two_triangles());
  EXPECT_EQ(parse_stl(bytes_of(text_stl() + text_stl()), "plate.stl").size(), 4u);  // several solids
}

TEST(Stl, TextIsRecognisedAsFarAsItIsRead) {
  std::string capitals = text_stl(), old_mac = text_stl();
  for (char& c : capitals) c = static_cast<char>(std::toupper(c));
  std::ranges::replace(old_mac, '\n', '\r');
  for (const std::string& text : {capitals, " \n\t" + text_stl(), "\xEF\xBB\xBF" + text_stl(), old_mac,
                                  text_stl() + "exported by hand\n2026\n"})
    EXPECT_EQ(parse_stl(bytes_of(text), "plate.stl"), two_triangles()) << text;
  expect_refused(bytes_of(text_stl() + "sold next\n facet normal 0 0 1\n"), "expected solid, found 'sold'");
  expect_refused(bytes_of("solid\r\nfacet normal 0 0 1\r\nouter lop"), "line 3: expected loop");
}

TEST(Stl, NothingIsWrittenThatIsTooLargeToBeRead) {
  EXPECT_EQ(
      what_of<std::invalid_argument>([&] { stl_bytes(std::vector<Triangle>(kMaxStlBytes / 50), "title"); }),
      "stl_bytes: 10737418 triangles make a file of 536870984 bytes, expected at most 536870912; try a "
      "coarser resolution");
}

TEST(Stl, LengthTellsBinaryFromTextWhateverTheFirstWord) {
  Bytes bytes = stl_bytes(two_triangles(), "title");
  std::memcpy(bytes.data(), "solid made by a careless exporter", 33);
  EXPECT_EQ(parse_stl(bytes, "plate.stl"), two_triangles());
  bytes.pop_back();  // now neither: cut off, and no text because of its zero bytes
  expect_refused(bytes, "announces 2 triangles, expected 184 bytes, found 183");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { stl_bytes({}, "solid"); }),
            "stl_bytes: the title begins with \"solid\", which marks a text file");
}

TEST(Stl, DamagedBinaryNamesTheTriangleOrTheLength) {
  const Bytes good = stl_bytes(two_triangles(), "title");
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), INFINITY, -1e7F}) {
    Bytes bad = good;
    std::memcpy(bad.data() + 84 + 50 + 12 + 8, &value, sizeof value);
    expect_refused(bad, "triangle 2 has the coordinate");
  }
  expect_refused(Bytes{}, "has 0 bytes");
  expect_refused(stl_bytes({}, "empty"), "holds no triangle");
  for (std::size_t length = 0; length < good.size(); ++length)
    expect_refused(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length)),
                   length < 84
                       ? "has " + std::to_string(length) + " bytes, expected an STL file of 84 or more"
                       : "expected 184 bytes, found " + std::to_string(length));
}

TEST(Stl, DamagedTextNamesTheLine) {
  const std::string good = text_stl();
  expect_refused(bytes_of("solid\nendsolid"), "holds no triangle");
  expect_refused(bytes_of("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 nan 0"),
                 "line 4: expected a number within +-1000000 mm, found 'nan'");
  expect_refused(bytes_of("solid\nfacet normal 0 0 1\nouter lop"), "line 3: expected loop, found 'lop'");
  expect_refused(bytes_of("solid\nfacet normal 0 0 1\nouter loop\nvertex 1 2"), "found the end of the file");
  expect_refused(bytes_of("solid\nfacet\n"), "expected normal");
  expect_refused(bytes_of("solids of gold"), "line 1: expected solid, found 'solids'");
  expect_refused(bytes_of("solid of gold"), "expected facet or endsolid, found the end of the file");
  for (std::size_t length = 0; length < good.rfind("endsolid") + 8; ++length)
    expect_refused(bytes_of(good.substr(0, length)), "export it again");
}

TEST(Stl, HostileHeadersCostNothing) {
  Bytes bytes(84);
  const std::clock_t begin = std::clock();
  for (const std::uint32_t count : {1u, 1000u, 0x7FFF'FFFFu, 0xFFFF'FFFFu}) {
    std::memcpy(bytes.data() + 80, &count, sizeof count);
    expect_refused(bytes, "announces " + std::to_string(count) + " triangles, expected " +
                              std::to_string(84 + 50 * std::uint64_t{count}) + " bytes, found 84");
  }
  // The count must not size anything: clearing what it asks for would take many seconds.
  EXPECT_LT(std::clock() - begin, CLOCKS_PER_SEC);
}

TEST(Stl, FilesAreReadWithALimit) {
  const TemporaryFolder folder;
  write_file(folder / "plate.stl", stl_bytes(two_triangles(), "title"));
  EXPECT_EQ(read_stl(folder / "plate.stl"), two_triangles());
  EXPECT_EQ(what_of<FileError>([&] { read_stl(folder / "missing.stl"); }),
            folder / "missing.stl" + ": cannot open the file: No such file or directory; check the name");
  write_file(folder / "huge.stl", std::string());
  std::filesystem::resize_file(folder / "huge.stl", kMaxStlBytes + 1);  // sparse
  EXPECT_EQ(what_of<FileError>([&] { read_stl(folder / "huge.stl"); }),
            folder / "huge.stl" + ": has 536870913 bytes, expected at most 536870912; is it the right file?");
}

TEST(Stl, FuzzCorpus) { EXPECT_GE(replay("stl", check_stl), 256); }

}  // namespace supertac::stl_test
