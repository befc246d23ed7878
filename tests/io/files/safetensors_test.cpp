#include "io/files/safetensors.h"

#include <sys/resource.h>

#include <ctime>

#include "io/files/file.h"
#include "io/numbers/hash.h"
#include "io/numbers/random.h"
#include "tests/io/faults.h"
#include "tests/sanitized.h"
#include "tests/support/tensor_file.h"

namespace supertac::safetensors_test {

constexpr std::uint64_t kMost = 1 << 26;
const std::string kNote = "\"quoted\", \\, \xc3\xa4";

std::string golden(const std::string& name) { return std::string(SUPERTAC_GOLDEN) + "/" + name; }

std::string refusal_of(const std::string& path) {
  return what_of<FileError>([&] { SafetensorsFile::read(path); });
}

/// A file of the header's text and `data_bytes` zeros.
std::string raw_file(const std::string& header, std::size_t data_bytes) {
  const std::uint64_t length = header.size();
  std::string bytes(8, '\0');
  std::memcpy(bytes.data(), &length, 8);
  return bytes + header + std::string(data_bytes, '\0');
}

void read_header(const std::string& header, std::size_t data_bytes = 0) {
  const std::string bytes = raw_file(header, data_bytes);
  SafetensorsFile::of(std::as_bytes(std::span(bytes)), "a");
}

/// Writes a file of about `bytes` bytes.
void write_example(const std::string& path, std::size_t bytes) {
  std::vector<float> values(bytes / 4);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>(RandomStream(1, 2).normal(i));
  const std::vector<double> times = {0.1, 0.2};
  write_safetensors(path, {{"kind", "example"}, {"note", kNote}},
                    {{"volts", "F32", {values.size()}, std::as_bytes(std::span(values))},
                     {"time_s", "F64", {2}, std::as_bytes(std::span(times))},
                     {"none", "U8", {0, 3}, {}}});
}

TEST(Safetensors, GoldenFileOfVersion1IsReadForEver) {
  const auto file = SafetensorsFile::read(golden("version_1.safetensors"));
  EXPECT_TRUE(file.has_checksum());
  EXPECT_EQ(file.metadata(), (std::map<std::string, std::string>{{"note", "quotes \" and \xc3\xa4"}}));
  EXPECT_EQ(file.f32("volts"), (std::vector<float>{0, 0.5, -1, 1e-3f, 2.5, 3}));
  EXPECT_EQ(file.f64("time_s"), (std::vector<double>{0.1, 1e300}));
  EXPECT_EQ(file.tensors().at("volts").shape, (std::vector<std::uint64_t>{2, 3}));
  EXPECT_EQ(file.tensors().at("empty").shape, (std::vector<std::uint64_t>{0, 4}));
  EXPECT_TRUE(file.bytes("empty").empty());
}

TEST(Safetensors, WritesTheBytesOfTheGoldenFile) {
  TemporaryFolder folder;
  TensorFile(SafetensorsFile::read(golden("version_1.safetensors"))).write(folder.file("a"));
  EXPECT_EQ(read_file(folder.file("a"), kMost), read_file(golden("version_1.safetensors"), kMost));
}

TEST(Safetensors, AccessErrorsSayWhatThereIs) {
  const auto file = SafetensorsFile::read(golden("version_1.safetensors"));
  EXPECT_EQ(what_of<FileError>([&] { file.f32("volt"); }),
            file.path() + ": has no tensor 'volt' (it has: 'bytes', 'empty', 'time_s', 'volts')");
  EXPECT_EQ(what_of<FileError>([&] { file.f32("time_s"); }),
            file.path() + ": tensor 'time_s' has type F64, expected F32");
}

TEST(Safetensors, FilesOfOtherWritersLoadWithoutChecksum) {
  TemporaryFolder folder;
  const std::string header = R"({"b":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}  )";
  write_file(folder.file("a"), raw_file(header, 4));
  const auto file = SafetensorsFile::read(folder.file("a"));
  EXPECT_FALSE(file.has_checksum());
  EXPECT_EQ(file.f32("b"), std::vector<float>{0});
}

TEST(SafetensorsDamage, EveryPrefixIsRefused) {
  TemporaryFolder folder;
  write_example(folder.file("a"), 2000);
  EXPECT_EQ(SafetensorsFile::read(folder.file("a")).metadata().at("note"), kNote);
  const std::string whole = read_text_file(folder.file("a"), kMost);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    write_file(folder.file("b"), whole.substr(0, length));
    ASSERT_NE(refusal_of(folder.file("b")), "nothing thrown") << length << " bytes";
  }
  write_file(folder.file("b"), whole + " ");
  EXPECT_NE(refusal_of(folder.file("b")), "nothing thrown");
}

TEST(SafetensorsDamage, EveryFlippedBitIsRefused) {
  TemporaryFolder folder;
  write_example(folder.file("a"), 16'000);
  std::string bytes = read_text_file(folder.file("a"), kMost);
  // Written in place: 130,000 atomic replacements would test the disk.
  FILE* file = std::fopen(folder.file("a").c_str(), "r+b");
  ASSERT_NE(file, nullptr);
  const auto put = [&](std::size_t position, char value) {
    std::fseek(file, static_cast<long>(position), SEEK_SET);
    std::fputc(value, file);
    std::fflush(file);
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      put(i, static_cast<char>(bytes[i] ^ (1 << bit)));
      ASSERT_NE(refusal_of(folder.file("a")), "nothing thrown") << "byte " << i << " bit " << bit;
    }
    put(i, bytes[i]);
  }
  std::fclose(file);
  EXPECT_EQ(refusal_of(folder.file("a")), "nothing thrown");
}

TEST(SafetensorsHostile, HeadersAreRefusedForTheirReason) {
  const std::pair<std::string, std::string> cases[] = {
      {"", "begin with"},
      {" {}", "begin with"},
      {"[]", "begin with"},
      {"{}\n", "end with"},
      {"{} x", "end with"},
      {"{", "end with"},
      {"{\"a\":}", "not valid JSON"},
      {std::string("{}\0}", 4), "NUL"},
      {R"({"a":1})", "tensor 'a': expected an object, found 1"},
      {R"({"a":null})", "tensor 'a': expected an object, found null"},
      {R"({"a":{}})", "needs exactly"},
      {R"({"a":{"dtype":"F32","shape":[1]}})", "needs exactly"},
      {R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0]}})", "needs exactly"},
      {R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4,8]}})", "needs exactly"},
      {R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4],"x":"y"}})",
       "tensor 'a' needs exactly dtype, shape and data_offsets [begin, end]"},
      {R"({"a":{"dtype":"F32","dtype":"F32","shape":[1],"data_offsets":[0,4]}})", "twice"},
      {R"({"a":{"dtype":"F32","shape":[0],"data_offsets":[0,0]},"a":{}})", "twice"},
      {R"({"__metadata__":{"a":"b","a":"c"}})", "twice"},
      {R"({"__metadata__":{},"__metadata__":{}})", "twice"},
      {R"({"__metadata__":{"a":{}}})", "'__metadata__' at 'a': expected a text, found {}"},
      {R"({"__metadata__":{"a":1}})", "expected a text, found 1"},
      {R"({"__metadata__":[]})", "expected an object, found []"},
      {R"({"a":{"dtype":"F99","shape":[1],"data_offsets":[0,4]}})", "unknown type 'F99'"},
      {R"({"a":{"dtype":"F32","shape":[-1],"data_offsets":[0,4]}})",
       "a whole number from 0 to 2^64 - 1, found -1"},
      {R"({"a":{"dtype":"F32","shape":[1.0],"data_offsets":[0,4]}})", "found 1.0"},
      {R"({"a":{"dtype":"F32","shape":[1e0],"data_offsets":[0,4]}})", "found 1.0"},
      {R"({"a":{"dtype":"F32","shape":[18446744073709551616],"data_offsets":[0,4]}})", "found 1.84467"},
      {R"({"a":{"dtype":"F32","shape":[4611686018427387905],"data_offsets":[0,4]}})", "too large"},
      {R"({"a":{"dtype":"U8","shape":[4294967296,4294967296],"data_offsets":[0,0]}})", "too large"},
      {R"({"a":{"dtype":"U8","shape":[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1],"data_offsets":[0,1]}})",
       "more than 16 numbers in tensor 'a' at 'shape'"},
      {R"({"a":{"dtype":"U8","shape":[[1]],"data_offsets":[0,1]}})",
       "tensor 'a' at 'shape': expected a whole number from 0 to 2^64 - 1, found [1]"},
      {R"({"a":{"dtype":1,"shape":[1],"data_offsets":[0,4]}})",
       "tensor 'a' at 'dtype': expected a text, found 1"},
      {R"({"a":{"dtype":"U8","shape":1,"data_offsets":[0,1]}})",
       "tensor 'a' at 'shape': expected a list, found 1"},
      {R"({"a":[[[[1]]]]})", "nested deeper than 4 levels"},
      {R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[4,0]}})", "spans"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,4]}})", "spans"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", "cut short"},
      {R"({"a":{"dtype":"U8","shape":[2],"data_offsets":[2,4]}})", "begins at byte 2, expected 0"},
      {R"({"a":{"dtype":"U8","shape":[3],"data_offsets":[0,3]},"b":{"dtype":"U8","shape":[2],"data_offsets":[2,4]}})",
       "begins at byte 2, expected 3"},
      {R"({"a":{"dtype":"U8","shape":[3],"data_offsets":[0,3]}})", "need 3 bytes of data, the file has 4"},
      {R"({"__metadata__":{"supertac_format":"2","checksum":"00000000"}})", "use a newer SuperTac"},
      {R"({"__metadata__":{"supertac_format":"one","checksum":"00000000"}})", "format version 'one'"},
      {R"({"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]},"__metadata__":{"supertac_format":"1"}})",
       "checksum is missing"},
      {R"({"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]},"__metadata__":{"checksum":"00000000"}})",
       "without a format version"},
      {R"({"__metadata__":{"supertac_format":"1","checksum":"123"},"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]}})",
       "malformed"},
  };
  for (const auto& [header, reason] : cases) {
    SCOPED_TRACE(header);
    EXPECT_ERROR(read_header(header, 4), FileError, reason);
  }
}

TEST(SafetensorsHostile, AHeaderOfTheLargestSizeIsStillRead) {
  std::string header = "{}";
  header.resize(1 << 20, ' ');
  EXPECT_NO_THROW(read_header(header));
  EXPECT_ERROR(read_header(header + " "), FileError, "header length 1048577, expected at most 1048576");
}

TEST(SafetensorsHostile, LengthsAreComparedBeforeMemoryIsAskedFor) {
  TemporaryFolder folder;
  for (const std::uint64_t length :
       {std::uint64_t{1} << 63, ~std::uint64_t{0}, (std::uint64_t{1} << 20) + 1, std::uint64_t{1} << 40}) {
    std::string bytes(16, ' ');
    std::memcpy(bytes.data(), &length, 8);
    write_file(folder.file("a"), bytes);
    EXPECT_ERROR(SafetensorsFile::read(folder.file("a")), FileError,
                 "header length " + std::to_string(length));
  }
  EXPECT_ERROR(
      read_header(R"({"a":{"dtype":"U8","shape":[1099511627776],"data_offsets":[0,1099511627776]}})", 4),
      FileError, "cut short");
}

long peak_kilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

/// Headers made to cost as much as they can.
std::vector<std::string> bombs() {
  constexpr std::size_t kCap = (1 << 20) - 64;
  std::string many = "{";
  for (int i = 0; many.size() < kCap - 100; ++i) {
    many +=
        (i > 0 ? ",\"" : "\"") + std::to_string(i) + R"(":{"dtype":"U8","shape":[0],"data_offsets":[0,0]})";
  }
  std::string keys = R"({"__metadata__":{)";
  for (int i = 0; keys.size() < kCap - 100; ++i)
    keys += (i > 0 ? ",\"" : "\"") + std::to_string(i) + "\":\"\"";
  return {"{\"a\":" + std::string(kCap, '[') + "}",
          std::string(kCap, '{') + "}",
          "{\"a\":{\"shape\":[" + std::string(kCap, '1') + "]}}",
          "{\"" + std::string(kCap, 'k') + "\":1}",
          many + "}",
          keys + "},\"a\":1}"};
}

TEST(SafetensorsHostile, BombsCostLittle) {
  TemporaryFolder folder;
  for (const std::string& header : bombs()) {
    write_file(folder.file("a"), raw_file(header, 0));
    const long before = peak_kilobytes();
    // Processor time, best of a few: this must not depend on what else the machine does. Measured: below 10
    // ms each, half a second on an emulated processor.
    double best = 1e9;
    for (int i = 0; i < 5; ++i) {
      const std::clock_t begin = std::clock();
      ASSERT_NE(refusal_of(folder.file("a")), "nothing thrown") << header.substr(0, 40);
      best = std::min(best, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    EXPECT_LT(best, 1.0) << header.substr(0, 40);
    EXPECT_LT(peak_kilobytes() - before, kSanitized ? 1 << 20 : 16 * 1024) << header.substr(0, 40);
  }
}

TEST(SafetensorsWrite, RefusesWhatItCouldNotReadBack) {
  TemporaryFolder folder;
  const std::vector<std::byte> data(4);
  using Metadata = std::map<std::string, std::string>;
  Metadata full;
  for (int i = 0; i < 4095; ++i) full[std::to_string(i)];
  const std::tuple<Metadata, std::vector<TensorToWrite>, std::string> cases[] = {
      {full, {}, "metadata expects at most 4094 fields, got 4095"},
      {{}, std::vector<TensorToWrite>(8193), "tensors expects at most 8192, got 8193"},
      {{}, {{"a", "F32", {2}, data}}, "tensor 'a' expects 8 bytes, got 4"},
      {{},
       {{"a", "X", {2}, data}},
       "tensor 'a' expects a known type, rank <= 16, below 2^64 bytes, got 'X' [2]"},
      {{}, {{"a", "F32", {1}, data}, {"a", "F32", {1}, data}}, "tensors expects names not taken, got 'a'"},
      {{}, {{"__metadata__", "F32", {1}, data}}, "tensors expects names not taken, got '__metadata__'"},
      {{{"checksum", ""}}, {}, "metadata expects no field that this function writes, got 'checksum'"},
      {{{"a", "\xff"}}, {}, "names and metadata expects valid UTF-8, got other bytes"},
      {{{"a", std::string(1 << 20, 'x')}}, {}, "header expects at most 1048576 bytes, got 1048648"}};
  for (const auto& [metadata, tensors, refusal] : cases)
    EXPECT_REFUSAL("write_safetensors: " + refusal, write_safetensors(folder.file("a"), metadata, tensors));
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(SafetensorsWrite, PiecesGiveTheSameBytesAsAWhole) {
  TemporaryFolder folder;
  std::vector<float> values(1000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  const auto bytes = std::as_bytes(std::span(values));
  const auto in_pieces = [&](std::size_t size) {
    return [&bytes, size](const ByteSink& sink) {
      for (std::size_t at = 0; at < bytes.size(); at += size)
        sink(bytes.subspan(at, std::min(size, bytes.size() - at)));
    };
  };
  write_safetensors(folder.file("whole"), {}, {{"a", "F32", {10, 100}, bytes}});
  write_safetensors(folder.file("pieces"), {}, {{"a", "F32", {10, 100}, {}, in_pieces(77)}});
  EXPECT_EQ(read_file(folder.file("whole"), kMost), read_file(folder.file("pieces"), kMost));
  EXPECT_THROW(write_safetensors(folder.file("short"), {}, {{"a", "F32", {10, 101}, {}, in_pieces(77)}}),
               std::invalid_argument);
}

TEST(Safetensors, NamesTheFirstOfManyTensors) {
  const TemporaryFolder folder;
  std::vector<TensorToWrite> tensors;
  for (int i = 100; i < 200; ++i) tensors.push_back({"tensor" + std::to_string(i), "U8", {0}, {}});
  write_safetensors(folder / "many", {}, tensors);
  const SafetensorsFile file = SafetensorsFile::read(folder / "many");
  const std::string text = what_of<FileError>([&] { file.f32("volts"); });
  EXPECT_TRUE(text.ends_with("'tensor114', 'tens...)")) << text;
}

class Provenance : public testing::Test {
 protected:
  ~Provenance() override { set_provenance(""); }

  std::string write(const std::string& name, float value) const {
    const std::vector<float> a{1, 2, value}, b{4};
    write_safetensors(
        folder_.file(name), {{"kind", "test"}},
        {{"z", "F32", {3}, std::as_bytes(std::span(a))}, {"a", "F32", {1}, std::as_bytes(std::span(b))}});
    return folder_.file(name);
  }
  TemporaryFolder folder_;
};

TEST_F(Provenance, IsInEveryFileAndNotInItsContent) {
  const std::string without = write("without", 3);
  set_provenance(R"({"command":"supertac-test"})");
  const std::string with = write("with", 3), other = write("other", 3.5F);
  EXPECT_EQ(SafetensorsFile::read(with).metadata().at("provenance"), R"({"command":"supertac-test"})");
  EXPECT_NE(read_text_file(with, kMost), read_text_file(without, kMost));
  EXPECT_EQ(content_hash(SafetensorsFile::read(without)), sha256(read_text_file(without, kMost)));
  EXPECT_EQ(content_hash(SafetensorsFile::read(with)), sha256(read_text_file(without, kMost)));
  EXPECT_NE(content_hash(SafetensorsFile::read(other)), sha256(read_text_file(without, kMost)));
}

}  // namespace supertac::safetensors_test
