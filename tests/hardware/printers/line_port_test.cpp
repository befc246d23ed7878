#include "hardware/printers/marlin_link.h"

#include "tests/hardware/fake_port.h"
#include "tests/support/test.h"

namespace supertac::line_port_test {

/// Says `text` over and over, `most` bytes at once and every `every_s` seconds.
class Talker : public FakePort {
 public:
  explicit Talker(const std::string& text, std::size_t most = 100, double every_s = 0.001)
      : most_(most), every_s_(every_s) {
    name_ = text;
  }
  Received read(std::span<std::byte> buffer, double) override {
    for (std::size_t i = 0; i < most_; ++i) said_ += name_[at_++ % name_.size()];
    now_ += every_s_;
    return hand_on(buffer);
  }

 private:
  std::size_t most_, at_ = 0;
  double every_s_;
};

TEST(LinePort, EndsInTimeWhateverComesForEver) {
  for (Talker talker : {Talker("x"), Talker("x", 1, 0.01), Talker("ok\n"), Talker("ok\n", 1, 0.01)}) {
    LinePort lines(talker);
    std::string line;
    int read = 0;
    while (read < 100'000 && lines.read(1.0, line)) ++read;
    EXPECT_NEAR(talker.now(), 1, 0.02) << read << " lines of " << talker.name();
    EXPECT_EQ(read > 0, talker.name() != "x");
    EXPECT_EQ(lines.no_text(), 0U);
  }
}

TEST(LinePort, GivesLinesWithoutBreaksBlanksAndEmptyOnes) {
  Talker talker("ok \r\n\n  \necho:busy\x01\n");
  LinePort lines(talker);
  std::string line;
  ASSERT_TRUE(lines.read(1.0, line));
  EXPECT_EQ(line, "ok");
  ASSERT_TRUE(lines.take(line));
  EXPECT_EQ(line, "echo:busy\x01");
  EXPECT_DOUBLE_EQ(lines.arrival_s(), 0.001);
  EXPECT_EQ(lines.bytes(), 100U);
  EXPECT_GT(lines.no_text(), 0U);
}

}  // namespace supertac::line_port_test
