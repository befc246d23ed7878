// The file is read as the specification says (https://mcap.dev/spec), by an index and without;
// tests/python/tools_test.py asks the public readers.
#include "io/files/mcap_file.h"

#include "io/numbers/hash.h"
#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::mcap_file_test {

class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text) {}
  template <class Number>
  Number number() {
    Number value{};
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string text() { return std::string(take(number<std::uint32_t>())); }
  std::string_view take(std::size_t size) {
    if (size > text_.size() - at_) throw std::out_of_range("behind the end");
    return text_.substr((at_ += size) - size, size);
  }
  std::size_t at() const { return at_; }
  bool ended() const { return at_ == text_.size(); }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
};

struct Message {
  std::uint16_t channel;
  std::uint32_t sequence;
  std::uint64_t log_time, publish_time;
  std::string text;
  bool operator==(const Message&) const = default;
};

Message message_of(Reader& record) {
  Message m{record.number<std::uint16_t>(),
            record.number<std::uint32_t>(),
            record.number<std::uint64_t>(),
            record.number<std::uint64_t>(),
            {}};
  return m;
}

struct Record {
  std::uint8_t opcode;
  std::size_t at;  // of its opcode
  std::string_view content;
};

std::vector<Record> records_of(std::string_view text, std::size_t at) {
  std::vector<Record> records;
  for (Reader reader(text.substr(at)); !reader.ended();) {
    const std::size_t begin = at + reader.at();
    const auto opcode = reader.number<std::uint8_t>();
    records.push_back({opcode, begin, reader.take(reader.number<std::uint64_t>())});
  }
  return records;
}

std::vector<Message> messages_of(std::string_view chunk) {
  std::vector<Message> messages;
  for (const Record& r : records_of(chunk, 0)) {
    EXPECT_EQ(r.opcode, 5);
    Reader reader(r.content);
    messages.push_back(message_of(reader));
    messages.back().text = r.content.substr(reader.at());
  }
  return messages;
}

std::uint32_t sum(std::string_view text) { return crc32(std::as_bytes(std::span(text))); }

const std::vector<McapChannel> kChannels = {{"/a", "A", "float32 y\n", {{"unit", "V"}}},
                                            {"/b", "B", "float32 x\n"}};

TEST(McapFile, HoldsEveryMessageInChunksThatItsIndexFinds) {
  const TemporaryFolder folder;
  const std::string path = folder / "a.mcap";
  std::vector<Message> written;
  {
    McapFile file(path, kChannels);
    for (std::uint32_t i = 0; i < 300; ++i) {
      const auto channel = static_cast<std::uint16_t>(i % 3 == 0);
      const std::uint32_t sequence = channel == 1 ? i / 3 : i - i / 3 - 1;
      written.push_back(
          {channel, sequence, 1000 + 10 * (i ^ 1U), i, std::string(10 * i, static_cast<char>('a' + i % 26))});
      file.add(channel, written.back().log_time, i, written.back().text);
    }
    file.close();
  }
  const std::string text = read_text_file(path, 1 << 24);
  constexpr std::string_view kMagic = "\x89MCAP0\r\n";
  ASSERT_TRUE(text.starts_with(kMagic));
  ASSERT_TRUE(text.ends_with(kMagic));
  const std::string_view inside = std::string_view(text).substr(0, text.size() - kMagic.size());
  const std::vector<Record> records = records_of(inside, kMagic.size());
  ASSERT_EQ(records.front().opcode, 1);
  ASSERT_EQ(records.back().opcode, 2);
  Reader header(records.front().content);
  EXPECT_EQ(header.text(), "ros2");
  EXPECT_EQ(header.text(), "supertac");

  Reader footer(records.back().content);
  const auto summary = footer.number<std::uint64_t>();
  EXPECT_EQ(footer.number<std::uint64_t>(), 0U);
  EXPECT_EQ(footer.number<std::uint32_t>(), sum(inside.substr(summary, inside.size() - 4 - summary)));

  std::vector<Message> found, by_index;
  std::map<std::size_t, std::string_view> chunks;  // by their place
  std::size_t channels = 0;
  for (const Record& r : records) {
    Reader reader(r.content);
    if (r.opcode == 4 && r.at < summary) {
      EXPECT_EQ(reader.number<std::uint16_t>(), channels);
      EXPECT_EQ(reader.number<std::uint16_t>(), channels + 1);  // its schema
      EXPECT_EQ(reader.text(), kChannels[channels].topic);
      EXPECT_EQ(reader.text(), "cdr");
      Reader metadata(reader.take(reader.number<std::uint32_t>()));
      for (const auto& [key, value] : kChannels[channels].metadata) {
        EXPECT_EQ(metadata.text(), key);
        EXPECT_EQ(metadata.text(), value);
      }
      EXPECT_TRUE(metadata.ended());
      ++channels;
    }
    if (r.opcode != 6) continue;
    const auto first = reader.number<std::uint64_t>(), last = reader.number<std::uint64_t>(),
               size = reader.number<std::uint64_t>();
    const auto crc = reader.number<std::uint32_t>();
    EXPECT_EQ(reader.text(), "");  // not compressed
    const std::string_view chunk = reader.take(reader.number<std::uint64_t>());
    EXPECT_EQ(chunk.size(), size);
    EXPECT_EQ(crc, sum(chunk));
    chunks[r.at] = chunk;
    const std::vector<Message> in_chunk = messages_of(chunk);
    const auto [least, most] = std::ranges::minmax(in_chunk, {}, &Message::log_time);
    EXPECT_EQ(least.log_time, first);
    EXPECT_EQ(most.log_time, last);
    found.insert(found.end(), in_chunk.begin(), in_chunk.end());
  }
  EXPECT_EQ(channels, 2U);
  EXPECT_GT(chunks.size(), 1U);
  EXPECT_EQ(found, written);

  for (const Record& r : records) {
    if (r.opcode != 8 || r.at < summary) continue;
    Reader reader(r.content);
    reader.take(16);
    const auto begin = reader.number<std::uint64_t>(), length = reader.number<std::uint64_t>();
    ASSERT_TRUE(chunks.contains(begin));
    EXPECT_EQ(begin + 9 + records_of(text.substr(begin, length), 0).front().content.size(), begin + length);
    Reader places(reader.take(reader.number<std::uint32_t>()));
    EXPECT_GT(reader.number<std::uint64_t>(), 0U);
    while (!places.ended()) {
      const auto channel = places.number<std::uint16_t>();
      Reader index(std::string_view(text).substr(places.number<std::uint64_t>()));
      EXPECT_EQ(index.number<std::uint8_t>(), 7);
      index.number<std::uint64_t>();
      EXPECT_EQ(index.number<std::uint16_t>(), channel);
      Reader entries(index.take(index.number<std::uint32_t>()));
      while (!entries.ended()) {
        const auto time = entries.number<std::uint64_t>(), at = entries.number<std::uint64_t>();
        Reader message(chunks[begin].substr(at + 9));
        by_index.push_back(message_of(message));
        EXPECT_EQ(by_index.back().log_time, time);
        EXPECT_EQ(by_index.back().channel, channel);
      }
    }
  }
  EXPECT_EQ(by_index.size(), written.size());
}

TEST(McapFile, WithoutMessagesIsWholeToo) {
  const TemporaryFolder folder;
  McapFile file(folder / "a.mcap", kChannels);
  EXPECT_THROW(read_file(folder / "a.mcap", 100), FileError);  // not before it is complete
  file.close();
  EXPECT_FALSE(read_file(folder / "a.mcap", 4096).empty());
}

// One chunk that was not written would be missing without a word.
TEST(McapFile, AfterAFailedWriteThereIsNoFile) {
  const TemporaryFolder folder;
  {
    const FaultInjection fault(4, ENOSPC, false);  // open, open, write the channels, write a chunk
    McapFile file(folder / "a.mcap", kChannels);
    EXPECT_THROW(file.add(0, 1, 1, std::string(300'000, 'x')), FileError);
    EXPECT_NO_THROW(file.add(0, 2, 2, "y"));
    EXPECT_THROW(file.close(), FileError);
  }
  EXPECT_EQ(folder.entries(), 0U);
}

}  // namespace supertac::mcap_file_test
