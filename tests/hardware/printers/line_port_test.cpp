#include "hardware/printers/marlin_link.h"

#include "tests/support/test.h"

namespace supertac::line_port_test {

/// Says `text` over and over, 100 bytes a millisecond.
class Talker : public Port {
 public:
  explicit Talker(std::string text) : text_(std::move(text)) {}
  const std::string& name() const override { return text_; }
  double now() override { return now_; }
  Received read(std::span<std::byte> buffer, double) override {
    const std::size_t count = std::min<std::size_t>(100, buffer.size());
    for (std::size_t i = 0; i < count; ++i) buffer[i] = static_cast<std::byte>(text_[at_++ % text_.size()]);
    return {count, now_ += 0.001};
  }
  double write(std::span<const std::byte>, double) override { return now_; }

 private:
  std::string text_;
  std::size_t at_ = 0;
  double now_ = 0;
};

TEST(LinePort, EndsInTimeWhereBytesComeForEverAndNoLineDoes) {
  Talker talker("x");
  LinePort lines(talker);
  std::string line;
  EXPECT_FALSE(lines.read(1.0, line));
  EXPECT_LT(talker.now(), 1.1);
  EXPECT_EQ(lines.no_text(), 0U);
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
