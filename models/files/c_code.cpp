#include "models/files/exports.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <set>
#include <stdexcept>

#include "c99_text.h"
#include "data/windows/live_window.h"
#include "data/windows/transforms.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/compiled/integer_plan.h"

namespace supertac {
namespace {

std::string text(Dim value) { return std::to_string(value); }

std::string list(const std::vector<Dim>& values) { return joined(values, ", "); }

// As C has it: 0.05, or 50.0, with all digits that tell it from its neighbours.
std::string number(double value) {
  std::string out = format(value);
  return out.find_first_of(".en") == std::string::npos ? out + ".0" : out;
}

std::string replaced(std::string in, const std::string& what, const std::string& with) {
  for (std::size_t at = in.find(what); at != std::string::npos; at = in.find(what, at + with.size()))
    in.replace(at, what.size(), with);
  return in;
}

std::string define(const std::string& name, const std::string& value, const std::string& about = "") {
  return "#define " + name + " " + value + (about.empty() ? "" : " /* " + about + " */") + "\n";
}

std::string at(int i) { return "&maps[" + std::to_string(i) + "]"; }

std::string shape_of(const c99::map& m) {
  return (m.height > 1 ? "[" + text(m.height) + "]" : "") +
         (m.height * m.width > 1 ? "[" + text(m.width) + "]" : "") + "[" + text(m.channels) + "] " +
         (m.bytes ? "bytes" : "numbers");
}

std::string maps_of(const IntegerPlan& plan) {
  std::string out = "static const struct map maps[] = {\n";
  for (std::size_t i = 0; i < plan.maps.size(); ++i) {
    const c99::map& m = plan.maps[i];
    const auto writer = std::ranges::find(plan.steps, static_cast<int>(i),
                                          [](const IntegerStep& s) { return s.maps.back(); });
    out += "    {" +
           list({m.offset, m.height, m.width, m.channels, m.margin_h, m.margin_w, m.bytes, m.zero}) +
           "}, /* " + std::to_string(i) + ": " + writer->name + ", " + shape_of(m) + " */\n";
  }
  return out + "};\n";
}

std::string product_of(const IntegerPlan& plan, const IntegerStep& s, const std::string& name) {
  const bool bytes = plan.map(s.maps[0]).bytes;
  const std::vector<std::uint8_t>& w = s.weights;
  const c99::product& p = s.product;
  std::string out = "/* " + s.name + ": " + shape_of(plan.map(s.maps[0])) + " -> " +
                    shape_of(plan.map(s.maps[1])) + ", " + text(p.segments * p.length) +
                    " weights an output */\n";
  constexpr std::size_t kPerLine = 24;
  out += std::string(bytes ? "static const uint8_t " : "static const int8_t ") + name + "_weights[" +
         std::to_string(w.size()) + "] = {";
  for (std::size_t i = 0; i < w.size(); ++i)
    out += (i % kPerLine == 0 ? "\n    " : " ") +
           std::to_string(bytes ? w[i] : static_cast<std::int8_t>(w[i])) + ",";
  out += "\n};\nstatic const struct outcome " + name + "_outcomes[" + std::to_string(s.outcomes.size()) +
         "] = {";
  for (std::size_t o = 0; o < s.outcomes.size(); ++o)
    out += (o % 4 == 0 ? "\n    {" : " {") + std::to_string(s.outcomes[o].offset) + ", " +
           std::to_string(s.outcomes[o].multiplier) + ", " + std::to_string(s.outcomes[o].shift) + "},";
  out += "\n};\nstatic const struct product " + name + " = {" + name + "_weights, " + name + "_outcomes, " +
         list({p.height, p.width, p.outputs, p.length, p.segments, p.slope, p.x_line, p.x_pixel, p.y_line,
               p.y_pixel, p.y_first}) +
         ", {" + list(std::vector<Dim>(p.segment, p.segment + p.segments)) + "}};\n\n";
  return out;
}

// The products, and the function that calls them and all else.
std::string network_of(const IntegerPlan& plan) {
  std::string products, calls;
  std::set<std::string> taken;
  for (const IntegerStep& s : plan.steps) {
    std::vector<std::string> arguments;
    if (s.function == "take_input") arguments.emplace_back("from");
    if (!s.weights.empty()) {
      const std::string whole = "NAME_" + replaced(s.name, ".", "_");
      std::string name = whole;
      for (int part = 1; !taken.insert(name).second; ++part) name = whole + "_" + std::to_string(part);
      products += product_of(plan, s, name);
      arguments.push_back("&" + name);
    }
    for (const int map : s.maps) arguments.push_back(map < 0 ? "0" : at(map));
    for (const std::int32_t number : s.numbers) arguments.push_back(std::to_string(number));
    if (s.writes_margin) calls += "  fill_margin(" + at(s.maps.back()) + ");\n";
    calls += "  " + s.function + "(" + joined(arguments, ", ") + "); /* " + s.name + " */\n";
  }
  calls += "  give(" + at(plan.picture) + ", picture);\n";
  if (plan.predicted_error >= 0)
    calls += "  if (predicted_error) give(" + at(plan.predicted_error) + ", predicted_error);\n";
  else
    calls += "  (void)predicted_error; /* the model predicts none */\n";
  return products +
         "void NAME_draw(const float from[TIMESTEPS * SIGNALS], float picture[PIXELS], float "
         "predicted_error[PIXELS]) {\n" +
         calls + "}\n\n";
}

// Enough for one window, and one more that is refused.
Dim self_test_frames(const ModelFile& file, double sensor_hz) {
  const WindowSettings w = file.windows();
  return static_cast<Dim>(std::ceil(w.timesteps / w.rate_hz * sensor_hz)) + 3;
}

// What NAME_self_test() of window.c returns where all bits are right, in 16 digits.
std::string self_test_hash(const ModelFile& file, double sensor_hz) {
  const WindowSettings w = file.windows();
  const double period = 1 / sensor_hz;
  LiveWindow live({.timesteps = w.timesteps,
                   .signals = file.array().signals(),
                   .rate_hz = w.rate_hz,
                   .scaling = w.scaling,
                   .filter_s = file.input.filter_s.value_or(0),
                   .frame_period_s = period});
  std::uint32_t random = 1;
  std::vector<float> frame(file.array().signals());
  for (Dim i = 0, n = self_test_frames(file, sensor_hz); i < n; ++i) {
    for (float& value : frame) {
      random = random * 1664525U + 1013904223U;
      value = static_cast<float>(w.scaling.rest - w.scaling.span * ((random >> 8) * 0x1p-24));
    }
    if (i != n / 2) live.push(static_cast<double>(i) * period, frame);
  }
  Tensor window(file.model->input_shape(1));
  live.window(window.values());
  const Estimate drawn = compiled(file, Precision::int8).estimate(window);
  Sha256 hash;
  hash.add(std::as_bytes(drawn.picture.values()));
  if (file.model->settings().predicted_error) hash.add(std::as_bytes(drawn.predicted_error.values()));
  return hash.hex().substr(0, 16);
}

// Behind the name of the model: every name of the file that is no other's business, so that several models
// fit into one unit. The file's own text has one such name on a line that begins with static, struct or
// union.
struct Privacy {
  std::string before, after;
};
Privacy privacy_of(const std::string& source) {
  Privacy p;
  std::set<std::string> taken;
  for (std::size_t at = 0, end; at < source.size(); at = end + 1) {
    end = std::min(source.find('\n', at), source.size());
    const std::string line = source.substr(at, end - at);
    if (line.starts_with("#define ")) {
      p.after += "#undef " + line.substr(8, line.find_first_of("( ", 8) - 8) + "\n";
    } else if (line.starts_with("static ") || line.ends_with(" {")) {
      const std::string head = line.substr(0, line.find_first_of("[(=;{"));
      const std::size_t last = head.find_last_not_of(' ') + 1, first = head.find_last_of(" *", last - 1) + 1;
      const std::string name = head.substr(first, last - first);
      if (line.starts_with(" ") || name.starts_with("NAME_") || !taken.insert(name).second) continue;
      p.before += "#define " + name + " NAME_" + name + "\n";
      p.after += "#undef " + name + "\n";
    }
  }
  return p;
}

// What stands before the network, as LiveWindow has it.
std::string window_constants(const ModelFile& file, double sensor_hz) {
  constexpr double kRoom = 1.25;  // frames may come a quarter faster
  const WindowSettings w = file.windows();
  const double period = 1 / sensor_hz, filter = file.input.filter_s.value_or(0);
  const double raw_span = std::max(0.0, filter - 0.5 * period);
  const auto frames = [&](double seconds) {
    return text(static_cast<Dim>(std::ceil(kRoom * seconds * sensor_hz)) + 2);
  };
  return define("RATE_HZ", number(w.rate_hz), "of the window's samples") +
         define("PERIOD_S", number(period), "of the sensor's frames") +
         define("MAX_GAP_S", number(longest_silence_s(period)), "a longer silence begins a new window") +
         define("CELL_SLACK", number(kCellSlack), "of a sample: time stamps are rounded") +
         define("RAW_SPAN_S", number(raw_span), "of the moving average") +
         define("RAW_FRAMES", filter > 0 ? frames(raw_span) : "0") +
         define("REST", number(w.scaling.rest), "a sample is (REST - value) / SPAN, 0 to 1") +
         define("SPAN", number(w.scaling.span)) +
         define("NORMALISED", w.scaling.per_window ? "1" : "0",
                "windows are brought to their own rest and gain") +
         define("SELF_TEST_FRAMES", text(self_test_frames(file, sensor_hz))) +
         define("PREDICTS_ERROR", file.model->settings().predicted_error ? "1" : "0") +
         define("LEAST_GAIN", number(kLeastGain) + "f") + define("REST_REMOVED", number(kRestRemoved) + "f") +
         define("REST_SHARE", text(kRestShare)) + define("TOP_RANK", text(kTopRank));
}

std::string header_of(const ModelFile& file, const IntegerPlan& plan, std::size_t weights, double sensor_hz,
                      const std::string& self_test, const std::string& top) {
  const NetworkFormat f = file.model->format();
  const std::string pixels = "UPPER_HEIGHT * UPPER_WIDTH";
  return top +
         "#ifndef UPPER_H\n#define UPPER_H\n\n#include <stdint.h>\n\n#ifdef __cplusplus\nextern \"C\" "
         "{\n#endif\n\n" +
         define("UPPER_SIGNALS", text(f.rows * f.columns * f.channels),
                "of a frame: " + text(f.rows) + " rows of " + text(f.columns) + " taxels, " +
                    text(f.channels) + " each") +
         define("UPPER_TIMESTEPS", text(f.frames), "samples of a window") +
         define("UPPER_HEIGHT", text(f.rows * f.scale), "of the picture, in pixels") +
         define("UPPER_WIDTH", text(f.columns * f.scale)) +
         define("UPPER_DELAY_S", number(file.input.delay_s),
                "a picture shows where the finger was so long before the newest frame") +
         define("UPPER_SENSOR_HZ", number(sensor_hz), "frames a second that it is made for") +
         define("UPPER_WORK_BYTES", text(plan.work_area),
                "of RAM for the network; its window takes 4 bytes a value") +
         define("UPPER_WEIGHT_BYTES", std::to_string(weights), "of flash") + R"(
/* One frame of the sensor, in its unit, row by row. 1 where a picture can be drawn, 0 while the window fills, and for
   a frame that is not finite or not later than the one before. */
int NAME_push(const float frame[UPPER_SIGNALS]);                    /* one period after the one before */
int NAME_push_at(double time_s, const float frame[UPPER_SIGNALS]);  /* with its time, where the sensor has a clock */

/* Draws the window that ends with the newest frame; 0 and nothing else while there is none.
   picture: [height][width], 0 is the flat plate and 1 its highest point. predicted_error: the same, how far from the
   truth a pixel is expected to be; may be null. */
int NAME_picture(float picture[)" +
         pixels + "], float predicted_error[" + pixels + R"(]);

/* The same for a window of your own: [timesteps][signals], scaled as in training. */
void NAME_draw(const float window[UPPER_TIMESTEPS * UPPER_SIGNALS], float picture[)" +
         pixels + "],\n               float predicted_error[" + pixels + R"(]);

/* Forgets all frames. */
void NAME_reset(void);

/* Draws one window of frames that the code itself makes, and forgets all frames. Returns the first
   64 bits of the SHA-256 of the picture and its predicted error, floats with their lowest byte first: UPPER_SELF_TEST
   where compiler and processor draw the bits of a PC, else another number, or 0. Both rooms are needed. */
#define UPPER_SELF_TEST )" +
         "0x" + self_test + R"(ull
uint64_t NAME_self_test(float picture[)" +
         pixels + "], float predicted_error[" + pixels + R"(]);

#ifdef __cplusplus
}
#endif

#endif
)";
}

void check(const std::string& name, double sensor_hz) {
  const bool identifier =
      !name.empty() && std::isdigit(static_cast<unsigned char>(name[0])) == 0 &&
      std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
  if (!identifier)
    throw std::invalid_argument(
        refusal("C code", "name", "an identifier of C, such as finger", in_quotes(name)));
  if (!(sensor_hz >= 1 && sensor_hz <= 100'000))
    throw std::invalid_argument(refusal("C code", "sensor_hz", "1 to 100000", format(sensor_hz)));
}

}  // namespace

CCode c_code_of(const ModelFile& file, const std::string& name, double sensor_hz,
                std::vector<ChainLink> chain) {
  check(name, sensor_hz);
  const auto plan = IntegerPlan::of(*file.model, file.int8_ranges());
  std::size_t weights = 0;  // bytes
  for (const IntegerStep& s : plan->steps) weights += s.weights.size() + 8 * s.outcomes.size();
  const std::string top = "/* " + name + ": tactile super-resolution, written by supertac-export";
  const std::string body =
      define("SIGNALS", "UPPER_SIGNALS") + define("TIMESTEPS", "UPPER_TIMESTEPS") +
      define("PIXELS", "(UPPER_HEIGHT * UPPER_WIDTH)") + define("WORK_BYTES", "UPPER_WORK_BYTES") +
      define("NUMBER_STEP", "(1.0f / " + text(Dim{1} << plan->fraction_bits) + ")") +
      window_constants(file, sensor_hz) +
      "\nunion work_area {\n  int32_t aligned;\n  uint8_t bytes[WORK_BYTES];\n};\nstatic union work_area "
      "work;\n" +
      define("WORK", "work.bytes") + "\n" + kTypes + "\n" + kKernels + "\n/* ---- The network. ---- */\n\n" +
      maps_of(*plan) + "\n" + network_of(*plan) + kWindow;
  const Privacy names = privacy_of(body);
  std::string upper = name;
  std::ranges::transform(upper, upper.begin(), [](unsigned char c) { return std::toupper(c); });
  const auto named = [&](const std::string& in) {
    return replaced(replaced(replaced(in, "NAME.h", name + ".h"), "NAME_", name + "_"), "UPPER_",
                    upper + "_");
  };
  CCode code{{}, {}, std::move(chain), weights, static_cast<std::size_t>(plan->work_area)};
  code.source = named(top + ". */\n#include \"NAME.h\"\n\n#include <string.h>\n\n" + kBegin + names.before +
                      "\n" + body + "\n" + names.after + kEnd);
  code.chain.push_back({"code", sha256(code.source)});
  std::string made_of = top + ", of what these SHA-256 name (supertac-check chain):\n";
  for (const ChainLink& link : code.chain) made_of += "   " + left_aligned(link.name, 11) + link.hash + "\n";
  code.chain.push_back({"picture", self_test_hash(file, sensor_hz)});
  code.header = named(header_of(file, *plan, weights, sensor_hz, code.chain.back().hash, made_of + "*/\n"));
  return code;
}

}  // namespace supertac
