#include "data/sensors/sensor.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

void expect(bool good, const std::string& key, const std::string& expected, const std::string& found) {
  if (!good) throw std::invalid_argument("\"" + key + "\" must be " + expected + ", found " + found);
}

void expect_text(const std::string& key, const std::string& text) {
  expect(!text.empty() && text.size() <= 200 && printable(text, 200) == text, key,
         "1 to 200 printable characters", in_quotes(text));
}

void check_scale(const SignalScale& s) {
  expect_text("unit", s.unit);
  const double largest = std::max(std::abs(s.low()), std::abs(s.high()));
  expect(largest <= 1e9 && s.high() - s.low() >= 1e-5 * largest && s.span != 0, "range",  // floats hold it
         "two numbers within 1e9, apart by at least 1e-5 of the larger",
         format(s.low()) + " to " + format(s.high()));
}

void check_format(const FrameFormat& f) {
  const auto one_of = [](const std::string& word, std::initializer_list<const char*> words) {
    return std::ranges::find(words, word) != words.end();
  };
  const bool text = f.kind == FrameKind::text;
  if (text || f.kind == FrameKind::json) {
    std::set<int> columns(f.skip.begin(), f.skip.end());
    if (text && f.time) columns.insert(f.time->column);
    expect(columns.size() == f.skip.size() + (text && f.time ? 1 : 0), "frame.skip",
           "other columns than that of time", "one twice");
    expect(columns.empty() || (*columns.begin() >= 0 && *columns.rbegin() < 100'000), "frame.skip",
           "columns from 0 to 99999", std::to_string(columns.empty() ? 0 : *columns.begin()));
  }
  if (text) {
    expect(f.separator == 0 || (f.separator >= ' ' ? f.separator <= '~' : f.separator == '\t'),
           "frame.separator", "one printable character or a tab", in_quotes(std::string(1, f.separator)));
    expect(f.separator == 0 || (std::string("0123456789.+-eE").find(f.separator) == std::string::npos &&
                                f.separator != f.decimal),
           "frame.separator", "no part of a number", in_quotes(std::string(1, f.separator)));
    expect(f.lines_per_frame >= 1 && f.lines_per_frame <= 300, "frame.lines_per_frame", "1 to 300",
           std::to_string(f.lines_per_frame));
    expect(f.prefix.size() <= 64, "frame.prefix", "at most 64 bytes", std::to_string(f.prefix.size()));
  }
  expect((text && f.checksum == "hex") || std::ranges::find(kChecksums, f.checksum) != std::end(kChecksums),
         "frame.checksum",
         std::string(text ? "hex, or " : "") + "one of " +
             joined(kChecksums, ", ", [](const char* kind) { return kind; }),
         in_quotes(f.checksum));
  if (f.kind != FrameKind::binary) return;
  expect(f.header.size() <= 64 && f.trailer.size() <= 64, "frame.header",
         "at most 64 bytes, as frame.trailer", std::to_string(std::max(f.header.size(), f.trailer.size())));
  expect(!f.header.empty() || !f.trailer.empty() || f.checksum != "none", "frame.header",
         "at least a byte where there is neither trailer nor checksum", "nothing");
  expect(one_of(f.type, {"u8", "i8", "u16", "i16", "u32", "i32", "f32"}), "frame.type",
         "u8, i8, u16, i16, u32, i32 or f32", in_quotes(f.type));
  expect(f.checksum_from.value_or(0) <= f.header.size(), "frame.checksum.from",
         "0 to " + std::to_string(f.header.size()) + ", within the header or right behind it",
         std::to_string(f.checksum_from.value_or(0)));
  if (f.time)
    expect(one_of(f.time->type, {"u16", "u32", "u64", "f64"}), "frame.time.type", "u16, u32, u64 or f64",
           in_quotes(f.time->type));
}

// What the fields of a binary frame hold together.
void check_fields(const FrameFormat& f, std::size_t values) {
  if (f.fields.empty()) return;
  std::size_t held = 0, times = 0, skipped = 0;
  for (const FrameField& field : f.fields) {
    if (field.is == FrameField::Is::values) held += field.count;
    if (field.is == FrameField::Is::skip) skipped += field.count;
    if (field.is == FrameField::Is::time) ++times;
    if (field.is == FrameField::Is::counter)
      expect(field.type == "u8" || field.type == "u16" || field.type == "u32", "frame.fields.counter",
             "u8, u16 or u32", in_quotes(field.type));
  }
  expect(f.fields.size() <= 64 && skipped <= 65536, "frame.fields",
         "at most 64 that skip at most 65536 bytes", std::to_string(f.fields.size()));
  expect(held == values, "frame.fields", "the frame's " + std::to_string(values) + " values",
         std::to_string(held));
  expect(times == (f.time ? 1 : 0), "frame.fields", "time once where there is frame.time, and nowhere else",
         std::to_string(times) + " times");
}

}  // namespace

std::size_t Sensor::values() const {
  if (order.empty()) return array.signals();
  return static_cast<std::size_t>(array.taxels() - std::ranges::count(order, -1)) *
         static_cast<std::size_t>(array.channels);
}

std::vector<int> Sensor::silent() const {
  std::vector<int> all = dead;
  for (std::size_t k = 0; k < order.size(); ++k)
    if (order[k] < 0) all.push_back(static_cast<int>(k));
  std::ranges::sort(all);
  all.erase(std::ranges::unique(all).begin(), all.end());
  return all;
}

void Sensor::arrange(std::span<const float> sent, std::span<float> signals) const {
  const auto channels = static_cast<std::size_t>(array.channels);
  for (std::size_t k = 0; k < signals.size() / channels; ++k) {
    const int from = order.empty() ? static_cast<int>(k) : order[k];
    if (from >= 0)
      std::copy_n(&sent[static_cast<std::size_t>(from) * channels], channels, &signals[k * channels]);
  }
  for (std::size_t s = 0; s < std::max(rest.size(), gain.size()); ++s) {
    const double from = rest.empty() ? scale.rest : double{rest[s]};
    signals[s] =
        static_cast<float>(scale.rest + (double{signals[s]} - from) * (gain.empty() ? 1 : double{gain[s]}));
  }
  fill_silent(signals);
}

void Sensor::fill_silent(std::span<float> signals) const {
  const std::vector<int> silent_ = silent();
  if (silent_.empty()) return;
  const int rows = array.rows, columns = array.columns, channels = array.channels;
  std::vector<bool> speaks(static_cast<std::size_t>(array.taxels()), true);
  for (const int k : silent_) speaks[static_cast<std::size_t>(k)] = false;
  for (int c = 0; c < channels; ++c) {
    // Of those that speak in [row,row_end) x [column,column_end).
    const auto mean = [&](int row, int row_end, int column, int column_end) -> std::optional<double> {
      double sum = 0;
      int count = 0;
      for (int y = std::max(row, 0); y < std::min(row_end, rows); ++y)
        for (int x = std::max(column, 0); x < std::min(column_end, columns); ++x) {
          const auto k = static_cast<std::size_t>(y * columns + x);
          if (speaks[k])
            sum += double{signals[k * static_cast<std::size_t>(channels) + static_cast<std::size_t>(c)]},
                ++count;
        }
      return count > 0 ? std::optional(sum / count) : std::nullopt;
    };
    const double of_all = mean(0, rows, 0, columns).value_or(0);
    for (const int k : silent_) {
      const int y = k / columns, x = k % columns;
      signals[static_cast<std::size_t>(k * channels + c)] =
          static_cast<float>(mean(y - 1, y + 2, x - 1, x + 2).value_or(of_all));
    }
  }
}

void Sensor::reorder(std::vector<int> other) {
  const auto taxels = static_cast<std::size_t>(array.taxels()),
             channels = static_cast<std::size_t>(array.channels);
  expect(other.empty() || other.size() == taxels, "order", std::to_string(taxels) + " places",
         std::to_string(other.size()));
  std::map<int, std::size_t> listed;  // by the place in the frame
  for (std::size_t k = 0; k < (order.empty() ? taxels : order.size()); ++k)
    if (const int at = order.empty() ? static_cast<int>(k) : order[k]; at >= 0) listed[at] = k;
  Sensor found = *this;
  found.dead.clear();
  for (std::size_t k = 0; k < taxels; ++k) {
    const int at = other.empty() ? static_cast<int>(k) : other.at(k);
    if (at < 0) continue;
    const auto from = listed.find(at);
    expect(from != listed.end(), "rest_order", "the taxel that a frame sends as " + std::to_string(at),
           "none: probe the rests again");
    if (std::ranges::find(dead, static_cast<int>(from->second)) != dead.end())
      found.dead.push_back(static_cast<int>(k));
    for (std::size_t c = 0; c < channels; ++c) {
      const std::size_t to = k * channels + c, of = from->second * channels + c;
      if (!rest.empty()) found.rest.at(to) = rest.at(of);
      if (!gain.empty()) found.gain.at(to) = gain.at(of);
    }
  }
  rest = found.rest, gain = found.gain, dead = found.dead, order = std::move(other);
}

void Sensor::check() const {
  expect_text("name", name);
  array.check();
  check_scale(scale);
  body.check();
  expect(rate_hz >= 1 && rate_hz <= 100'000, "rate_hz", "1 to 100000", format(rate_hz));
  expect_text("port", port);
  check_format(frame);
  if (frame.kind == FrameKind::board)
    expect(array == TaxelArray{}, "frame.kind", "text, json or binary where the array is not the rig's 4x4",
           "\"board\" and " + array.text());
  const auto taxels = static_cast<std::size_t>(array.taxels());
  std::set<int> places;
  std::size_t filled = 0;
  for (const int place : order)
    if (place >= 0) places.insert(place), ++filled;
  expect(order.empty() || (order.size() == taxels && places.size() == filled && filled > 0 &&
                           *places.rbegin() == static_cast<int>(filled) - 1),
         "order",
         "row-major, column-major, or for each of the " + std::to_string(taxels) +
             " taxels its place in the frame, from 0 and each once, -1 where there is none",
         std::to_string(order.size()) + " places, " + std::to_string(places.size()) + " different");
  if (frame.kind == FrameKind::binary) check_fields(frame, values());
  for (const int k : dead)
    expect(k >= 0 && k < array.taxels(), "dead", "taxels 0 to " + std::to_string(taxels - 1),
           std::to_string(k));
  for (const auto& [key, list] : {std::pair("rest", &rest), std::pair("gain", &gain)})
    expect(list->empty() || list->size() == array.signals(), key,
           "a number for each of the " + std::to_string(array.signals()) + " signals",
           std::to_string(list->size()));
  expect(follow_rest_s == 0 || (follow_rest_s >= 1 && follow_rest_s <= 3600), "follow_rest_s", "1 to 3600",
         format(follow_rest_s));
  for (const float g : gain)
    expect(g >= 0.01F && g <= 100, "gain", "numbers of 0.01 to 100", format(double{g}));
  expect(std::ranges::all_of(rest, [](float r) { return std::isfinite(r); }), "rest", "finite numbers",
         "one that is not");
  expect(silent().size() < taxels, "dead", "fewer than all taxels", std::to_string(taxels));
}

FrameLoad load_of(std::span<const float> signals, int channels, const SignalScale& scale) {
  FrameLoad load;
  const auto of_taxel = static_cast<std::size_t>(channels);
  for (; signals.size() >= of_taxel; signals = signals.subspan(of_taxel)) {
    double squares = 0, share = 0;
    for (const float signal : signals.first(of_taxel)) {
      share = (scale.rest - static_cast<double>(signal)) / scale.span;
      squares += share * share;
      load.saturated += std::abs(share) >= 1;
    }
    load.total_force += channels == 1 ? share : std::sqrt(squares);
  }
  return load;
}

}  // namespace supertac
