#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <typeinfo>

#include "data/clock/frame_clock.h"
#include "data/frames/binary_decoder.h"
#include "data/frames/sensor_decoder.h"
#include "data/recordings/imports/imports.h"
#include "data/recordings/recording.h"
#include "data/scores/baselines.h"
#include "data/sensors/rest_tracker.h"
#include "data/windows/windows.h"
#include "hardware/ports/errors.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "models/files/model_file.h"
#include "tests/apps/hostile/hostile.h"
#include "tests/fuzz/journal_properties.h"
#include "tests/support/tensor_file.h"

namespace supertac {
namespace {

constexpr double kEvilNumbers[] = {0,     -1,       1e-30,     1e30,
                                   -1e30, 1e9,      -1e9,      4.2e9,
                                   1e300, INFINITY, -INFINITY, std::numeric_limits<double>::quiet_NaN()};

double evil_number(const RandomStream& random, std::uint64_t at) {
  return kEvilNumbers[random.bits(at) % std::size(kEvilNumbers)];
}

// Any element of a container.
auto one_of(auto& all, std::uint32_t bits) {
  return std::next(all.begin(), static_cast<std::ptrdiff_t>(bits % all.size()));
}

// Some values of one tensor, or all.
template <class Number>
void lie_in(Bytes& bytes, const RandomStream& random) {
  const std::size_t count = bytes.size() / sizeof(Number);
  if (count == 0) return;
  const std::size_t first = random.bits(20) % count;
  const std::size_t last =
      random.bits(21) % 3 == 0 ? count : std::min(count, first + 1 + random.bits(22) % 9);
  for (std::size_t i = random.bits(21) % 6 == 0 ? 0 : first; i < last; ++i) {
    const auto value = static_cast<Number>(evil_number(random, 23));
    std::memcpy(&bytes[i * sizeof value], &value, sizeof value);
  }
}

void lie_in_json(nlohmann::ordered_json& value, const RandomStream& random) {
  if (value.is_structured() && !value.empty() && random.bits(12) % 2 == 0) {
    value = *one_of(value, random.bits(13));
  } else if (random.bits(14) % 3 == 0) {
    value = evil_value(random, 15);
  } else if (random.bits(14) % 3 == 1) {
    value = evil_number(random, 16);
  } else {
    value = static_cast<std::int64_t>(random.bits(17)) - (std::int64_t{1} << 31);
  }
}

// Of a text that is JSON one value in it; of another all.
void lie_in_text(std::string& text, const RandomStream& random) {
  try {
    auto json = nlohmann::ordered_json::parse(text);
    if (json.is_object() && !json.empty()) {
      lie_in_json(*one_of(json, random.bits(10)), random);
      text = json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
      return;
    }
  } catch (const nlohmann::json::exception&) {  // no JSON
  }
  text = evil_value(random, 11);
}

// One entry says something else: a text of the metadata, values, rows, a shape, a name.
void lie_in_file(TensorFile& file, const RandomStream& random) {
  TensorFile::Entry& tensor = file.tensors[random.bits(0) % file.tensors.size()];
  const std::uint32_t what = random.bits(1) % 8;
  if (what < 3 && !file.metadata.empty()) {
    lie_in_text(one_of(file.metadata, random.bits(2))->second, random);
  } else if (what < 6) {
    tensor.dtype == "F64" ? lie_in<double>(tensor.bytes, random) : lie_in<float>(tensor.bytes, random);
  } else if (what == 6 && !tensor.shape.empty() && tensor.shape[0] > 0) {
    const std::uint64_t row = tensor.bytes.size() / tensor.shape[0];
    const std::uint64_t rows = random.bits(3) % 2 == 0 ? tensor.shape[0] - 1 : tensor.shape[0] + 1;
    tensor.bytes.resize(rows * row), tensor.shape[0] = rows;
  } else if (random.bits(4) % 2 == 0) {
    std::ranges::reverse(tensor.shape);
  } else {
    tensor.name += "x";
  }
}

/// What follows reading; a plain runtime_error is a message of ours.
void expect_typed(const std::function<void()>& use) {
  try {
    use();
  } catch (const std::runtime_error& error) {
    if (typeid(error) != typeid(std::runtime_error)) throw;
  }
}

void use_recording(const std::string& path, const RandomStream&) {
  WindowSet windows({.timesteps = 32, .scale = 2});
  windows.add(read_recording(path));
  if (windows.size() == 0) return;
  std::vector<float> truth(windows.image().pixels());
  for (const std::size_t i : {std::size_t{0}, windows.size() - 1}) {
    (void)windows.raw_window(i);
    windows.truth(i, truth);
    (void)windows.zone(i);
  }
}

void use_model(const std::string& path, const RandomStream&) {
  const ModelFile file = load_model(path);
  (void)CompiledModel(*file.model).estimate(Tensor::full(file.model->input_shape(1), 0.5F));
}

void use_pairs(const std::string& path, const RandomStream&) {
  WindowSet frames({.timesteps = 1});
  for (const Recording& recording : import_pairs(SafetensorsFile::read(path))) frames.add(recording);
  std::vector<std::uint32_t> all(frames.size());
  std::iota(all.begin(), all.end(), 0U);
  (void)fit_baselines(frames, all);
}

void use_sensor(const std::string&, const RandomStream& random) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(
      R"({"name":"mat","rows":3,"columns":4,"pitch_mm":[5,5],"channels":1,"unit":"counts","pressed":"higher",
          "range":[40,900],"rate_hz":100,"port":"udp::5005","order":[0,1,2,3,4,5,6,7,8,9,10,11],"dead":[3],
          "rest":[1,2,3,4,5,6,7,8,9,10,11,12],"gain":[1,1,1,1,1,1,2,2,2,2,2,2],"follow_rest_s":5,
          "frame":{"kind":"binary","header":"AA55","type":"u16","endian":"big","checksum":"sum8",
                   "time":{"type":"u32","unit":"ms"}}})");
  const auto value = one_of(json, random.bits(0));
  auto& part =
      value->is_object() && random.bits(1) % 4 != 0
          ? (*value)[std::array{"kind", "header", "type", "endian", "checksum", "time"}[random.bits(2) % 6]]
          : *value;
  lie_in_json(part, random);
  const Sensor sensor =
      sensor_of_json(json.dump(2, ' ', true, nlohmann::ordered_json::error_handler_t::replace), "sensor");
  sensor.check();
  const auto decoder = make_decoder(sensor);
  FrameClock clock(clock_settings(sensor));
  std::vector<FrameDate> dates;
  RestTracker rest(sensor);
  std::vector<float> signals(sensor.array.signals());
  Bytes noise(20'000);
  for (std::size_t i = 0; i < noise.size(); ++i)
    noise[i] = i % 31 == 0   ? std::byte{0xAA}
               : i % 31 == 1 ? std::byte{0x55}
                             : static_cast<std::byte>(random.bits(100 + i / 7));
  decoder->push(noise, [&](const DecodedFrame& frame) {
    sensor.arrange(frame.values, signals);
    const FrameArrival arrival{1, 0, frame.time_s};
    clock.date({&arrival, 1}, dates);
    rest.follow(dates[0].time_s, signals);
  });
}

// Legs and positions that nobody can have made, with right checksums.
void use_journal(const std::string& path, const RandomStream& random) {
  std::remove(path.c_str());
  {
    JournalWriter writer(path, random.bits(0) % 4 == 0
                                   ? evil_value(random, 1)
                                   : R"({"version":1,"plate":"plain","trial":1,"speed_mm_s":10})");
    double time = 1;
    for (std::uint64_t i = 0; i < 60; ++i) {
      const RandomStream draw(random.bits(2), i);
      const auto number = [&](std::uint64_t at, double right) {
        return draw.bits(at) % 8 == 0 ? evil_number(draw, at + 50) : right;
      };
      const Leg leg{static_cast<int>(draw.bits(1) % 3),
                    static_cast<Phase>(draw.bits(2) % 5),
                    {number(3, 1), number(4, 2), number(5, 3)},
                    {number(6, 1), number(7, 12), number(8, 3)},
                    number(9, 10),
                    number(10, time),
                    number(11, time + 1),
                    number(12, time)};
      const std::uint32_t what = draw.bits(0) % 8;
      if (what < 2) writer.event(time, event_text(leg, what == 0));
      if (what == 2)
        writer.event(time, event_text(PositionSample{number(13, time), number(14, 0.001), leg.to}));
      if (what == 3) writer.event(time, evil_value(draw, 15));
      if (what > 3) {
        Bytes frame(rig::kFrameBytes);
        write_frame({}, std::span(frame).first<rig::kFrameBytes>());
        writer.append(JournalStream::board, RecordKind::received, number(16, time), frame);
      }
      time += 0.001;
    }
    writer.close();
  }
  check_journal(read_file(path, 1 << 24));
}

}  // namespace

Counts lying_files(const std::string& folder, std::uint64_t n, std::uint64_t seed) {
  Counts counts;
  (void)good_recording(folder), (void)good_model(folder), (void)good_pairs(folder);
  const SafetensorsFile recording = SafetensorsFile::read(folder + "/recording"),
                        model = SafetensorsFile::read(folder + "/model"),
                        pairs = SafetensorsFile::read(folder + "/pairs");
  struct Kind {
    const char* name;
    void (*use)(const std::string& path, const RandomStream&);
    const SafetensorsFile* good = nullptr;  ///< of files whose lies are written before they are used
  };
  const Kind kinds[] = {{"recording", use_recording, &recording},
                        {"model", use_model, &model},
                        {"pairs", use_pairs, &pairs},
                        {"sensor", use_sensor},
                        {"journal", use_journal}};
  const std::string path = folder + "/lie";
  for (std::uint64_t i = 0; i < n; ++i, ++counts["lying files"]) {
    const RandomStream random(seed, i);
    const Kind& kind = kinds[i % std::size(kinds)];
    try {
      if (kind.good != nullptr) {
        TensorFile file(*kind.good);
        lie_in_file(file, random);
        file.write(path);
      }
    } catch (const std::invalid_argument&) {  // no such file can be written
      continue;
    }
    judge_reading(
        "lying file " + std::to_string(i) + ", " + kind.name,
        [&] { expect_typed([&] { kind.use(path, random); }); }, counts);
  }
  return counts;
}

}  // namespace supertac
