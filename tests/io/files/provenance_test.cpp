#include "io/files/provenance.h"

#include "io/files/file.h"
#include "io/numbers/sha256.h"
#include "tests/support/test.h"

namespace supertac::provenance_test {

std::string bytes_of(const std::string& path) { return read_text_file(path, 1 << 20); }

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
  EXPECT_NE(bytes_of(with), bytes_of(without));
  EXPECT_EQ(content_hash(SafetensorsFile::read(without)), sha256(bytes_of(without)));
  EXPECT_EQ(content_hash(SafetensorsFile::read(with)), sha256(bytes_of(without)));
  EXPECT_NE(content_hash(SafetensorsFile::read(other)), sha256(bytes_of(without)));
}

}  // namespace supertac::provenance_test
