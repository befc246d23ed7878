// MCAP (https://mcap.dev/spec): messages of named channels with their times, what Foxglove, Rerun,
// PlotJuggler and ros2 bag open.
#pragma once

#include <cstdint>
#include <exception>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/file.h"

namespace supertac {

struct McapChannel {
  std::string topic;        ///< such as "/supertac/picture"
  std::string schema;       ///< its name, such as "sensor_msgs/msg/Image"
  std::string schema_text;  ///< the definition, as ROS 2 writes it
  std::map<std::string, std::string> metadata = {};
};

/// Writes one file of ROS 2's messages (profile "ros2", encoding "cdr"), in chunks of uncompressed messages
/// with an index, so that players can jump. It appears under its name at close(), complete (AtomicFile).
class McapFile {
 public:
  /// Throws FileError.
  McapFile(const OutputPath& output, std::span<const McapChannel> channels);
  /// A message of channels[channel]. Times are nanoseconds since 1970: when it was taken down, and when it
  /// was sent. Throws FileError.
  void add(std::size_t channel, std::uint64_t log_time, std::uint64_t publish_time, std::string_view message);
  /// Throws FileError, again when add() has.
  void close();

 private:
  struct Entry {
    std::uint64_t time, offset;  // of a message: its time, and where it begins in the chunk
  };
  struct Span {
    std::uint64_t first = ~std::uint64_t{0}, last = 0;  // times
    void add(std::uint64_t time);
    std::string text() const;
  };
  void write(std::string_view text);
  void write_chunk();

  AtomicFile file_;
  std::string channels_;                      // their records, and those of their schemas
  std::uint64_t at_ = 0;                      // bytes written
  std::exception_ptr failure_;                // of a write
  std::string chunk_;                         // its messages
  std::vector<std::vector<Entry>> in_chunk_;  // by channel
  Span chunk_span_, span_;
  std::string chunk_indexes_;          // their records
  std::vector<std::uint64_t> counts_;  // of messages, by channel
  std::uint32_t chunks_ = 0;
};

}  // namespace supertac
