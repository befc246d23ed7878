// Layouts of text that nobody chose: drawn from a seed, probed, and read by the draft.

#include "data/frames/probe.h"
#include "data/frames/sensor_decoder.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "tests/support/draws.h"

namespace supertac::text_layouts_test {

struct TextLayout {
  std::string what;
  std::vector<Heard> heard;
  std::size_t values = 0;
  std::vector<std::vector<double>> sent;  // [frame][value]; NaN: none
  std::vector<double> time_s;             // [frame]
  bool clock = false;                     // the lines say it
};

std::string clock_of_day(double s) {
  const auto two = [](int n) { return (n < 10 ? "0" : "") + std::to_string(n); };
  const int whole = static_cast<int>(s), ms = static_cast<int>(std::lround((s - whole) * 1000)) % 1000;
  const std::string of = std::to_string(1000 + ms);
  return two(whole / 3600) + ":" + two(whole / 60 % 60) + ":" + two(whole % 60) + "." + of.substr(1);
}

TextLayout text_layout_of(std::uint64_t seed) {
  Draws draw(seed, 57);
  constexpr std::pair<std::size_t, std::size_t> kArrays[] = {{4, 4},  {3, 3}, {8, 8},  {4, 6},
                                                             {6, 10}, {2, 5}, {16, 16}};
  const auto [rows, columns] = kArrays[draw.below(std::size(kArrays))];
  const std::size_t values = rows * columns;
  constexpr const char* kBetween[] = {",", ";", "\t", " ", ", ", " | ", "; "};
  const std::string between = kBetween[draw.below(std::size(kBetween))];
  const int decimals = draw.chance(0.4) ? 1 + static_cast<int>(draw.below(3)) : 0;
  const bool comma = decimals > 0 && between[0] != ',' && draw.chance(0.5);
  constexpr std::pair<const char*, const char*> kAround[] = {{"", ""},        {"(", ")"}, {"[", " ]"},
                                                             {"/*", "*/"},    {"<", ">"}, {"data: ", ""},
                                                             {"[INFO] ", ""}, {"", ";"},  {"$TAX,", ""}};
  auto [open, close] = kAround[draw.below(std::size(kAround))];
  const std::size_t stamp = draw.below(6);  // none, none, ms, us, s, monitor
  const bool counter = draw.chance(0.3), sum = decimals == 0 && draw.chance(0.2), star = draw.chance(0.15);
  const std::size_t form = draw.below(10);  // 0, 1: several lines; 2: labels; 3: row: values
  const bool several = form < 2, labelled = form == 2, by_rows = form == 3;
  const bool dead = draw.chance(0.3), none = draw.chance(0.15), boot = draw.chance(0.3),
             wide = draw.chance(0.1), remarks = draw.chance(0.2);
  const double base = draw.chance(0.3) ? -200 : 300, apart = draw.chance(0.5) ? 3 : 40;
  TextLayout layout;
  layout.values = values;
  layout.what = "seed " + std::to_string(seed) + ", " + std::to_string(rows) + "x" + std::to_string(columns) +
                " between '" + between + "' in " + open;
  layout.clock = stamp >= 2 && !several && !by_rows;
  std::vector<double> rest;
  for (std::size_t k = 0; k < values; ++k) rest.push_back(base + apart * draw.normal());
  const auto written = [&](double v) {
    std::string text = format(v, decimals);
    if (comma) std::ranges::replace(text, '.', ',');
    return text;
  };
  if (boot)
    layout.heard.push_back(
        {0.9, "ets Jun  8 2016 00:22:57\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\nsensor v1.2.3 ready\r\n"});
  layout.heard.push_back({0.95, "7" + between + "8\r\n"});
  for (int n = 0; n < 240; ++n) {
    const double t = 1 + 0.02 * n;
    std::vector<double> now;
    for (std::size_t k = 0; k < values; ++k) {
      double v = rest[k] + 1.5 * draw.normal() +
                 (k == values / 2 + static_cast<std::size_t>(n / 60) && n / 30 % 2 == 1 ? 250 : 0);
      if (dead && k == values / 3) v = 0;
      const double scale = std::pow(10.0, decimals);
      now.push_back(std::round(v * scale) / scale);
    }
    std::string front;
    if (stamp == 2) front = std::to_string(5000 + 20 * n) + between;
    if (stamp == 3) front = std::to_string(123456 + 20000 * n) + between;
    if (stamp == 4) front = format(12.5 + 0.02 * n, 3) + between;
    if (counter) front += std::to_string(n % 256) + between;
    std::string text;
    double all = 0;
    for (std::size_t k = 0; k < values; ++k) {
      if (labelled) text += "s" + std::to_string(k) + ":";
      text += none && k == values / 4 ? "nan" : written(now[k]);
      all += now[k];
      const bool ends = (several || by_rows) && (k + 1) % columns == 0;
      if (k + 1 < values) text += ends ? "\r\n" : between;
      if (by_rows && ends && k + 1 < values) text += "row " + std::to_string((k + 1) / columns) + ": ";
    }
    if (none) now[values / 4] = std::nan("");
    if (by_rows) {
      text = "row 0: " + text;
    } else if (several) {
      text += "\r\n";
    } else {
      if (sum && !none)
        text += between + std::to_string(static_cast<long long>(std::fmod(std::fmod(all, 256) + 256, 256)));
      text = open + front + text + close;
    }
    if (star && !several && !by_rows) {
      unsigned crossed = 0;
      for (const char c : text.substr(text[0] == '$' ? 1 : 0)) crossed ^= static_cast<unsigned char>(c);
      text += "*" + hex_of_bytes({static_cast<char>(crossed)});
    }
    if (stamp == 5 && !several && !by_rows) text = clock_of_day(84000.5 + 0.02 * n) + " -> " + text;
    text += "\r\n";
    if (draw.chance(0.02))
      text.erase(text.size() / 2, text.size() / 5);  // damaged
    else
      layout.sent.push_back(now), layout.time_s.push_back(t);
    if (remarks && n % 37 == 5 && !several && !by_rows) text += "battery low\r\n";
    layout.heard.push_back({t, text});
  }
  if (wide)
    for (Heard& chunk : layout.heard) {
      std::string twice;
      for (const char c : chunk.bytes) twice += c, twice += '\0';
      chunk.bytes = twice;
    }
  return layout;
}

/// Objects of JSON, scientific notation, a header and two arrays in a line.
TextLayout second_layout_of(std::uint64_t seed) {
  Draws draw(seed, 57);
  constexpr std::pair<std::size_t, std::size_t> kArrays[] = {{4, 4}, {5, 5}, {8, 8}, {4, 6}};
  const auto [rows, columns] = kArrays[draw.below(std::size(kArrays))];
  const std::size_t values = rows * columns, form = draw.below(4);
  const std::size_t stamp = draw.below(4);  // none, ms, us, s
  const bool nested = draw.chance(0.5), counter = draw.chance(0.5), pose = draw.chance(0.5);
  const double base = 300 + 100 * draw.normal();
  constexpr const char* kForms[] = {"JSON", "scientific", "header", "two arrays"};
  TextLayout layout;
  layout.values = values, layout.clock = stamp > 0;
  layout.what = "second family, seed " + std::to_string(seed) + ", " + std::to_string(rows) + "x" +
                std::to_string(columns) + ", " + kForms[form];
  layout.heard.push_back({0.95, "half of a line\n"});
  for (int n = 0; n < 240; ++n) {
    const double t = 1 + 0.02 * n;
    std::vector<double> now;
    std::string text;
    for (std::size_t k = 0; k < values; ++k) {
      const double v = base + 5 * static_cast<double>(k % 7) + 1.5 * draw.normal() +
                       (k == values / 2 + static_cast<std::size_t>(n / 60) && n / 30 % 2 == 1 ? 250 : 0);
      now.push_back(std::round(v));
      const bool begins = nested && k % columns == 0, ends = nested && (k + 1) % columns == 0;
      if (form == 0 && begins) text += "[";
      if (form == 1)
        text += format(now[k] / 100, 2) + "e+02";
      else
        text += format(now[k], 0);
      if (form == 0 && ends) text += "]";
      if (k + 1 < values) text += form == 3 ? " " : ",";
    }
    const std::string time = stamp == 1   ? std::to_string(700 + 20 * n)
                             : stamp == 2 ? std::to_string(98765 + 20000 * n)
                                          : format(3.5 + 0.02 * n, 3);
    // Orientation or acceleration beside the taxels: slow, with decimals.
    std::string others;
    for (int k = 0; k < 3; ++k)
      others += (k > 0 ? std::string(form == 3 ? " " : ",") : "") + format(0.3 * k + 0.01 * draw.normal(), 3);
    if (form == 0) {
      text = "\"taxels\":[" + text + "]";
      if (pose) text += ",\"imu\":[" + others + "]";
      if (counter) text = "\"seq\":" + std::to_string(n) + "," + text;
      if (stamp > 0) text = "\"t\":" + time + "," + text;
      text = "{" + text + "}";
    } else if (form == 3) {
      text = "taxels: " + text + " | imu: " + others;
      if (stamp > 0) text = "t=" + time + " " + text;
    } else {
      if (counter) text = std::to_string(n) + "," + text;
      if (stamp > 0) text = time + "," + text;
    }
    if (form == 2 && n % 80 == 3) {
      std::string names = std::string(stamp > 0 ? "time," : "") + (counter ? "seq," : "");
      for (std::size_t k = 0; k < values; ++k) names += (k > 0 ? ",p" : "p") + std::to_string(k);
      text = names + "\n" + text;
    }
    layout.sent.push_back(now), layout.time_s.push_back(t);
    layout.heard.push_back({t, text + "\n"});
  }
  return layout;
}

/// Exports and logs: names that tell channels and other quantities apart, decimal commas of several widths,
/// thousands, hexadecimal bytes behind words, numbered taxels, a taxel a line, units and brackets that vary.
/// And firmware's habits: glued units, a line for each taxel with its row and column, hexadecimal without 0x,
/// a baseline that drifts beside the signals.
TextLayout third_layout_of(std::uint64_t seed) {
  Draws draw(seed + 4000, 57);
  const std::size_t form = seed % 16, rows = 2 + draw.below(3), columns = 3 + draw.below(3);
  const std::size_t cells = rows * columns, values = form == 1 ? 3 * cells : cells;
  constexpr const char* kWhat[] = {"names",       "channels",         "two hands",        "decimal commas",
                                   "thousands",   "hexadecimal",      "numbered",         "a taxel a line",
                                   "units",       "brackets",         "labelled movie",   "Fortran",
                                   "glued units", "row,column,value", "bare hexadecimal", "drift"};
  const bool firmware = form >= 12, stamped = form == 12 && draw.chance(0.5);
  const std::string between = form == 3 || form == 4 ? ";" : draw.chance(0.5) ? (firmware ? " " : ",") : "\t";
  const std::string unit = draw.chance(0.5) ? "g" : "mV";
  TextLayout layout;
  layout.what = "third family, seed " + std::to_string(seed) + ", " + kWhat[form];
  layout.values = form == 15 ? 2 * values : values;
  layout.clock = form <= 3 || form == 6 || form == 7 || stamped;
  std::string names = "time";
  for (std::size_t k = 0; k < values; ++k)
    names += between + (form == 1   ? std::string(1, "xyz"[k % 3]) + std::to_string(k / 3)
                        : form == 2 ? (2 * k < values ? "left" : "right") + std::to_string(k)
                                    : "E" + std::to_string(k));
  std::string all = form <= 2 ? names + (form == 0 ? between + "PDC" + between + "PAC" : "") + "\n" : "";
  std::vector<double> rest;
  for (std::size_t k = 0; k < values; ++k)
    rest.push_back(firmware ? 20 + static_cast<double>(draw.below(form == 14 ? 3 : 9))
                            : (form == 4   ? 1000
                               : form == 9 ? 0
                                           : 300) +
                                  std::round(60 * draw.normal()));
  const auto comma = [](std::string text) { return std::ranges::replace(text, '.', ','), text; };
  for (int n = 0; n < 250; ++n) {
    const double t = 1 + 0.02 * n;
    std::vector<double> now;
    std::string text = form == 3 ? comma(format(t, 2)) : layout.clock && !stamped ? format(t, 2) : "";
    if (form == 5) text = "can0 100 [" + std::to_string(values) + "]";
    if (form == 6) text = "<f t=" + text + ">";
    if (form == 10) text = "Frame " + std::to_string(n) + "\n";
    for (std::size_t k = 0; k < values; ++k) {
      const bool pressed = static_cast<std::size_t>(n / 20) % values == k;
      double v =
          rest[k] + (firmware ? draw.normal() + (pressed ? 9 : 0) : 3 * draw.normal() + (pressed ? 700 : 0));
      if (form == 5) v = std::clamp(v / 4, 0.0, 255.0);
      now.push_back(form == 3 || form == 11 || form == 12 ? std::round(10 * v) / 10 : std::round(v));
      const std::string plain = format(now[k], 0), mark = text.empty() ? "" : between;
      const int whole = static_cast<int>(now[k]);
      if (form == 3)
        text += mark + comma(format(now[k], 1));
      else if (form == 4)
        text += mark + (plain.size() > 3 ? plain.substr(0, plain.size() - 3) + " ,"[seed / 16 % 2] +
                                               plain.substr(plain.size() - 3)
                                         : plain);
      else if (form == 5 || form == 14)
        text += (text.empty() ? "" : " ") + hex_of_bytes({static_cast<char>(whole)});
      else if (form == 6)
        text += "<s i=\"" + std::to_string(k) + "\">" + plain + "</s>";
      else if (form == 7)
        all += text + between + std::to_string(k) + between + plain + "\n";
      else if (form == 8)
        text += (k > 0 ? " " : "") + (whole >= 1000 ? format(now[k] / 1000, 3) + "k" : plain);
      else if (form == 9)
        text += (k > 0 ? " " : "") + (whole < 0 ? "(" + format(-now[k], 0) + ")" : plain);
      else if (form == 10)
        text += plain + ((k + 1) % columns == 0 ? "\n" : between);
      else if (form == 11)
        text += (k > 0 ? " " : "") + format(now[k] / 1000, 4) + "D+03";
      else if (form == 12)
        text += mark + format(now[k], 1) + unit;
      else if (form == 13)
        text += std::to_string(k / columns) + "," + std::to_string(k % columns) + "," + plain +
                (k + 1 < values ? "\r\n" : "\r");
      else
        text += mark + plain;
    }
    if (form == 0)
      text +=
          between + std::to_string(2000 + draw.below(3)) + between + std::to_string(1900 + draw.below(90));
    if (stamped) text = clock_of_day(84000.5 + 0.02 * n) + " -> " + text;
    if (form == 15) {
      text = "now: " + text + "\r\nbase:";
      for (std::size_t k = 0; k < values; ++k)
        now.push_back(rest[k] + n / 40), text += (k > 0 ? between : " ") + format(now.back(), 0);
    }
    if (firmware)
      layout.heard.push_back({t, text + "\n"});
    else if (form != 7)
      all += text + "\n";
    layout.sent.push_back(now), layout.time_s.push_back(t);
  }
  if (!firmware) layout.heard = {{1, all}};
  return layout;
}

/// Right: all frames that were sent but two, as they were sent and with their times where the lines say them;
/// none besides. A frame with "nan" has the others' mean there.
bool reads(const TextLayout& layout, const Sensor& draft) {
  if (draft.values() != layout.values || draft.frame.time.has_value() != layout.clock) return false;
  if (layout.what.ends_with("channels") && draft.array.channels != 3) return false;
  const auto decoder = make_decoder(draft);
  std::size_t next = 0, right = 0, wrong = 0;
  std::optional<double> time_s;
  double sent_s = 0;
  for (const Heard& chunk : layout.heard)
    decoder->push(std::as_bytes(std::span(chunk.bytes)), [&](const DecodedFrame& frame) {
      const auto same = [&](const std::vector<double>& sent) {
        for (std::size_t k = 0; k < sent.size(); ++k)
          if (std::isfinite(sent[k]) && std::abs(double{frame.values[k]} - sent[k]) > 1e-3) return false;
        return true;
      };
      for (std::size_t i = next; i < std::min(next + 9, layout.sent.size()); ++i) {
        if (!same(layout.sent[i])) continue;
        if (layout.clock && !frame.time_s) ++wrong;
        if (time_s && std::abs((*frame.time_s - *time_s) - (layout.time_s[i] - sent_s)) > 2e-3) ++wrong;
        if (layout.clock) time_s = frame.time_s, sent_s = layout.time_s[i];
        ++right, next = i + 1;
        return;
      }
      ++wrong;
    });
  return wrong == 0 && right + 2 >= layout.sent.size();
}

/// `count` seeds from `first` or SUPERTAC_FIRST_SEED on: none is drafted wrong, at least `share` of them
/// right.
void expect_right_or_refused(TextLayout (*layout_of_seed)(std::uint64_t), int count, double share,
                             std::uint64_t first = 1) {
  int right = 0, refused = 0, silent = 0;
  const std::uint64_t from = number_of("SUPERTAC_FIRST_SEED", first);
  for (std::uint64_t seed = from; seed < from + static_cast<std::uint64_t>(count); ++seed) {
    const TextLayout layout = layout_of_seed(seed);
    const ProbeReport report = probe(layout.heard, "here", {});
    const std::string said = joined(report.says, "\n");
    if (!report.draft) {
      ++refused;
      EXPECT_GT(report.says.back().size(), 20U);
      if (std::getenv("SUPERTAC_LAYOUTS") != nullptr)
        printf("refused %s\n%s\n", layout.what.c_str(), said.c_str());
    } else if (reads(layout, *report.draft)) {
      ++right;
    } else {
      ++silent;
      ADD_FAILURE() << layout.what << "\n" << layout.heard.back().bytes << said;
    }
  }
  EXPECT_GE(right, share * count) << refused << " refused, " << silent << " wrong";
}

TEST(TextLayouts, AreDraftedRightOrRefused) { expect_right_or_refused(text_layout_of, 80, 0.85); }
// Lines of a frame that rise in one column, with a nan where it falls; a sum behind a time of day, an arrow,
// a word and a counter; UTF-16 whose text is refused and whose bytes would be a binary frame.
TEST(TextLayouts, OnceWrongAreRightOrRefused) {
  expect_right_or_refused(text_layout_of, 1, 1, 2911073);
  expect_right_or_refused(text_layout_of, 1, 1, 2911136);
  expect_right_or_refused(text_layout_of, 1, 0, 4006051);
}
// Of the third those with names, channels, commas, numbers of taxels, movies, Fortran's and glued units.
TEST(TextLayouts, ExportsAndHabitsAreNeverWrong) { expect_right_or_refused(third_layout_of, 96, 0.37); }
TEST(TextLayouts, OfObjectsAndSeveralArraysToo) { expect_right_or_refused(second_layout_of, 40, 0.85); }

}  // namespace supertac::text_layouts_test
