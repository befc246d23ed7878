// Tampers with a training in a hundred ways, and asks its ledger for the first step and array that differ.
//   ledger_tampering RESULTS.csv
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>

#include "data/recordings/simulator.h"
#include "io/numbers/random.h"
#include "layers/checkpoint.h"
#include "models/training/ledger.h"

namespace supertac {
namespace {

constexpr std::int64_t kSteps = 40;
constexpr int kTamperings = 100;

TrainingSettings settings_of(std::uint64_t seed, double learning_rate) {
  TrainingSettings s;
  s.model = SuperTacSettings::of_preset("tiny");
  s.model.timesteps = 32;
  s.epochs = 100;
  s.batch = 8;
  s.seed = seed;
  s.learning_rate = learning_rate;
  s.augment = kStandardAugmentation;
  return s;
}

struct Tampering {
  std::string kind;  // "bit", "batch", "rate", "seed"
  std::int64_t step = 0;
  std::string tensor{};  // of a bit
};

class Runs {
 public:
  explicit Runs(std::string folder)
      : folder_(std::move(folder)), windows_({.timesteps = 32, .rate_hz = 100, .stride = 4}) {
    windows_.add(simulate_pass(Plate::named("ridges6"), {.from_mm = 20, .to_mm = 45}), ".");
    all_.resize(windows_.size());
    for (std::uint32_t i = 0; i < all_.size(); ++i) all_[i] = i;
  }

  Trainer trainer(std::uint64_t seed = 0, double learning_rate = 1e-3) const {
    return Trainer(windows_, all_, settings_of(seed, learning_rate));
  }

  // The trainer's state in another trainer, `skipped` steps later.
  void move_state(const Trainer& from, Trainer& to, std::int64_t skipped) const {
    const std::string path = folder_ + "/state.safetensors";
    from.save(path, {});
    const SafetensorsFile file = SafetensorsFile::read(path);
    std::map<std::string, std::string> metadata = file.metadata();
    metadata["step"] = std::to_string(from.step() + skipped);
    metadata["training"] = to.objective().text();
    std::vector<std::pair<std::uint64_t, TensorToWrite>> order;
    for (const auto& [name, info] : file.tensors())
      order.push_back({info.begin, {name, info.dtype, info.shape, file.bytes(name)}});
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<TensorToWrite> tensors;
    for (auto& [begin, tensor] : order) tensors.push_back(std::move(tensor));
    write_safetensors(path, metadata, tensors);
    to.restore(path, {});
  }

  Ledger ledger(const Tampering& t, const RandomStream& random) const {
    Ledger ledger{.every = 1, .names = {}, .lines = {}};
    Trainer own = trainer();
    Trainer other = trainer(t.kind == "seed" ? 1 : 0, t.kind == "rate" ? 1.001e-3 : 1e-3);
    own.for_each_tensor(
        [&](const std::string& name, std::span<const real>) { ledger.names.push_back(name); });
    Trainer* now = &own;
    std::optional<LedgerWriter> writer(std::in_place, own, 1);
    for (std::int64_t step = 1; step <= kSteps; ++step) {
      if (step == t.step && t.kind == "batch") move_state(own, own, 1);
      if (step == t.step && (t.kind == "rate" || t.kind == "seed")) {
        move_state(own, other, 0);
        writer.emplace(other, 1, ledger.lines.empty() ? nullptr : &ledger.lines.back());
        now = &other;
      }
      try {
        now->train_step();
      } catch (const TrainingStopped&) {
        break;  // a flipped bit made a number that is not finite
      }
      if (step == t.step && t.kind == "bit") flip(*now, t.tensor, random);
      ledger.lines.push_back(*writer->after_step());
    }
    return ledger;
  }

 private:
  static void flip(Trainer& trainer, const std::string& name, const RandomStream& random) {
    for (const Parameter& p : trainer.model().parameters()) {
      if (p.name != name) continue;
      Variable v = p.value;
      const auto i = static_cast<std::size_t>(random.uniform(10) * static_cast<double>(v.size()));
      std::uint32_t bits = 0;
      std::memcpy(&bits, &v.mutable_value().values()[i], sizeof bits);
      bits ^= 1U << (random.bits(11) % 32);
      std::memcpy(&v.mutable_value().values()[i], &bits, sizeof bits);
    }
  }

  std::string folder_;
  WindowSet windows_;
  std::vector<std::uint32_t> all_;
};

int run(const std::string& results) {
  const std::string folder = std::filesystem::temp_directory_path() / "ledger_tampering";
  std::filesystem::create_directories(folder);
  const Runs runs(folder);
  const Ledger honest = runs.ledger({}, {0, 0});
  if (first_difference(honest, runs.ledger({}, {0, 0}))) return 1;
  const Trainer any = runs.trainer();
  const std::vector<Parameter>& parameters = any.model().parameters();
  std::ofstream out(results);
  out << "tampering,kind,step,tensor,step found,tensor found,right\n";
  int right = 0;
  for (int i = 0; i < kTamperings; ++i) {
    const RandomStream random(19, static_cast<std::uint64_t>(i));
    const char* const kinds[] = {"bit", "batch", "rate", "seed"};
    Tampering t{.kind = kinds[i % 4],
                .step = 2 + static_cast<std::int64_t>(random.uniform(0) * (kSteps - 2))};
    if (t.kind == "bit")
      t.tensor =
          parameters[static_cast<std::size_t>(random.uniform(1) * static_cast<double>(parameters.size()))]
              .name;
    const auto d = first_difference(honest, runs.ledger(t, random));
    const bool found = d && d->step == t.step && (t.kind == "bit" ? d->what == t.tensor : d->what != "");
    right += found;
    out << i + 1 << ',' << t.kind << ',' << t.step << ',' << t.tensor << ',' << (d ? d->step : 0) << ','
        << (d ? d->what : "") << ',' << (found ? "yes" : "no") << '\n';
  }
  std::filesystem::remove_all(folder);
  std::cout << right << " of " << kTamperings << " found, with step and array\n";
  return right == kTamperings ? 0 : 1;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: ledger_tampering RESULTS.csv\n";
    return 2;
  }
  return supertac::run(argv[1]);
}
