#include <fstream>
#include <functional>
#include <iostream>
#include <vector>

#include "data/frames/binary_decoder.h"
#include "data/plates/plate.h"
#include "data/plates/stl.h"
#include "data/recordings/imports/imports.h"
#include "data/recordings/recording.h"
#include "data/simulation/simulator.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/clock.h"
#include "io/numbers/random.h"
#include "models/files/model_file.h"
#include "tests/apps/hostile/hostile.h"
#include "tests/fuzz/journal_properties.h"
#include "tests/fuzz/stl_properties.h"

namespace supertac {
namespace {

Bytes bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::string_view text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// What it reads, from a good beginning.
struct Reader {
  const char* name;
  Bytes good;
  std::function<void(const Bytes&)> read;
};

/// `header`: what stands in its header besides.
Bytes good_journal(const std::string& path, const std::string& header = "") {
  JournalWriter writer(path, R"({"version":1,"plate":"plain","trial":1,"speed_mm_s":10)" + header + "}");
  const Leg leg{1, Phase::slide, {0, 0, 0}, {0, 10, 0}, 10, 1, 2.1};
  writer.event(1, event_text(leg, false));
  for (int i = 0; i < 50; ++i) {
    Bytes frame(rig::kFrameBytes);
    write_frame({}, std::span(frame).first<rig::kFrameBytes>());
    writer.append(JournalStream::board, RecordKind::received, 1 + 1e-3 * i, frame);
  }
  writer.event(2.1, event_text(leg, true));
  writer.close();
  return read_file(path, 1 << 20);
}

std::string numpy_file() {
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (8, 2, 3), }";
  header.resize(117, ' ');
  return std::string("\x93NUMPY\x01\x00\x76\x00", 10) + header + "\n" + std::string(8 * 6 * 4, '\x3f');
}

// Its file is some kilobytes, so that most mutants hit what is read first.
Recording short_recording() {
  constexpr std::size_t kFrames = 40;
  Recording recording = simulate_pass(Plate::named("plain"), {.from_mm = 50, .to_mm = 52});
  recording.time_s.resize(kFrames), recording.signals.resize(kFrames * rig::kTaxels);
  recording.position_mm.resize(2 * kFrames), recording.lift_mm.resize(kFrames);
  return recording;
}

}  // namespace

Bytes good_recording(const std::string& folder) {
  write_recording(folder + "/recording", short_recording());
  return read_file(folder + "/recording", 1 << 24);
}

Bytes good_model(const std::string& folder) {
  const std::string path = folder + "/model";
  Rng rng(1);
  const SuperTac model({.timesteps = 32, .latent = 3, .scale = 2, .channels = 8, .rcabs = 1}, rng);
  save_model(path, model, {}, {});
  return read_file(path, 1 << 24);
}

Bytes good_pairs(const std::string& folder) {
  const std::string path = folder + "/pairs";
  const std::vector<float> input(4 * 16, 0.5F), target(4 * 256, 0.25F);
  write_safetensors(path, {},
                    {{"input", "F32", {4, 1, 4, 4}, std::as_bytes(std::span(input))},
                     {"target", "F32", {4, 1, 16, 16}, std::as_bytes(std::span(target))}});
  return read_file(path, 1 << 20);
}

void judge_reading(const std::string& what, const std::function<void()>& read, Counts& counts) {
  const auto found = [&](const char* kind, const std::string& why) {
    ++counts[kind];
    std::cerr << what << ": " << why << '\n';
  };
  // Of this thread: other work of the machine is no reader's fault.
  const double begin = seconds_of(CLOCK_THREAD_CPUTIME_ID);
  try {
    read();
  } catch (const FileError&) {
  } catch (const HardwareError&) {
  } catch (const JsonError&) {
  } catch (const std::invalid_argument&) {
  } catch (const std::logic_error& error) {
    found("crashes", error.what());
  } catch (const std::exception& error) {
    found("raw exceptions", error.what());
  }
  const double took = seconds_of(CLOCK_THREAD_CPUTIME_ID) - begin;
  if (took > 0.1) found("slow mutants", std::to_string(took) + " s");
}

namespace {

std::vector<Reader> readers(const std::string& folder) {
  std::string lines;
  for (int i = 0; i < 20; ++i)
    lines += "2.40 2.41 2.42 2.43 2.44 2.45 2.40 2.41 2.42 2.43 2.44 2.45 2.40 2.41 2.42 2.43\n";
  const Bytes recording = good_recording(folder);
  const auto from_file = [folder](auto read, const std::string& name = "/mutant") {
    return [file = folder + name, read](const Bytes& bytes) {
      // Not write_file(): a million syncs.
      std::ofstream(file, std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
      read(file);
    };
  };
  Bytes frames(4 * rig::kFrameBytes);
  for (int i = 0; i < 4; ++i)
    write_frame({}, std::span(frames).subspan(i * rig::kFrameBytes).first<rig::kFrameBytes>());
  return {{"journal", good_journal(folder + "/journal"), [](const Bytes& b) { check_journal(b); }},
          {"sensor's journal",
           good_journal(folder + "/of_sensor",
                        ",\"sensor\":" + json_of(Sensor{}).dump() + ",\"bed\":" + json_of(Bed{}).dump()),
           [](const Bytes& b) { check_journal(b); }},
          {"stl", stl_bytes(mesh_of(Plate::named("plain")), "x"), [](const Bytes& b) { check_stl(b); }},
          {"safetensors", recording, from_file([](const std::string& f) { (void)SafetensorsFile::read(f); })},
          {"recording", recording, from_file([](const std::string& f) { (void)read_recording(f); })},
          {"text", bytes_of(lines), from_file([](const std::string& f) {
             std::size_t dropped = 0;
             (void)import_text_pass(f, dropped);
           })},
          {"table", bytes_of("ms,a,b,\"c\"\n# a remark\n0,1,2,3\n10,+1,2,3\n20,1,nan,3\n"),
           from_file([](const std::string& f) { (void)read_table(f); })},
          {"array", bytes_of(numpy_file()),
           from_file([](const std::string& f) { (void)read_table(f); }, "/mutant.npy")},
          {"json", bytes_of(R"({"a":[1,2,{"b":"c"}],"d":1e5,"e":null})"),
           [](const Bytes& b) { (void)parse_json_limited(text_of(b)); }},
          {"reply", bytes_of("X:99.70 Y:101.17 Z:91.81 E:0.00 Count X:1 Y:2 Z:3"),
           [](const Bytes& b) { (void)parse_reply(text_of(b)); }},
          {"frames", frames,
           [](const Bytes& b) {
             BoardDecoder decoder;
             decoder.push(b, [](const DecodedFrame&) {});
           }},
          {"plate", bytes_of("bumps12+ridges6h1.5"),
           [](const Bytes& b) {
             const std::string name(text_of(b));
             if (!Plate::is_file(name)) (void)Plate::named(name);
           }},
          {"model", good_model(folder), from_file([](const std::string& f) {
             try {
               (void)load_model(f);
             } catch (const std::runtime_error& error) {
               if (!std::string(error.what()).starts_with(f)) throw;  // it names the file, else it is raw
             }
           })},
          {"pairs", good_pairs(folder),
           from_file([](const std::string& f) { (void)import_pairs(SafetensorsFile::read(f)); })}};
}

Bytes mutant_of(const Bytes& good, const RandomStream& random) {
  Bytes mutant = good;
  std::uint64_t at = 0;
  for (std::uint32_t changes = 1 + random.bits(at++) % 8; changes > 0 && !mutant.empty(); --changes) {
    const std::size_t place = random.bits(at++) % mutant.size();
    const auto begin = mutant.begin() + static_cast<std::ptrdiff_t>(place);
    const auto length =
        static_cast<std::ptrdiff_t>(std::min<std::size_t>(random.bits(at++) % 64, mutant.size() - place));
    switch (random.bits(at++) % 6) {
      case 0:
        *begin ^= static_cast<std::byte>(1U << (random.bits(at++) % 8));
        break;
      case 1:
        *begin = static_cast<std::byte>(random.bits(at++) % 256);
        break;
      case 2:
        mutant.erase(begin, begin + length);
        break;
      case 3: {
        const Bytes copy(begin, begin + length);
        mutant.insert(begin, copy.begin(), copy.end());
        break;
      }
      case 4:
        std::fill(begin, begin + length, static_cast<std::byte>(random.bits(at++) % 2 == 0 ? 0xFF : 0));
        break;
      default:
        if (random.bits(at++) % 8 == 0) mutant.resize(place);
    }
  }
  return mutant;
}

}  // namespace

Counts mutants_of_readers(const std::string& folder, std::uint64_t n, std::uint64_t seed) {
  Counts counts;
  const std::vector<Reader> all = readers(folder);
  for (std::uint64_t i = 0; i < n; ++i) {
    const Reader& reader = all[i % all.size()];
    const Bytes mutant = mutant_of(reader.good, RandomStream(seed, i));
    judge_reading(
        std::string(reader.name) + " " + std::to_string(i), [&] { reader.read(mutant); }, counts);
    ++counts["mutants"];
  }
  return counts;
}

}  // namespace supertac
