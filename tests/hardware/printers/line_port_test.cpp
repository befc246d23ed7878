#include "hardware/printers/marlin_link.h"

#include "tests/support/test.h"

namespace supertac::line_port_test {

/// Says `text` over and over, `most` bytes at once and every `every_s` seconds.
class Talker : public Port {
 public:
  explicit Talker(std::string text, std::size_t most = 100, double every_s = 0.001)
      : text_(std::move(text)), most_(most), every_s_(every_s) {}
  const std::string& name() const override { return text_; }
  double now() override { return now_; }
  Received read(std::span<std::byte> buffer, double) override {
    const std::size_t count = std::min(most_, buffer.size());
    for (std::size_t i = 0; i < count; ++i) buffer[i] = static_cast<std::byte>(text_[at_++ % text_.size()]);
    return {count, now_ += every_s_};
  }
  double write(std::span<const std::byte>, double) override { return now_; }

 private:
  std::string text_;
  std::size_t most_, at_ = 0;
  double every_s_, now_ = 0;
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
