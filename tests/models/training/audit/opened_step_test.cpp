// An opened step: it changes nothing, ends in the ledger's line, and brings whatever is planted in it down to
// operator and entry. SUPERTAC_PLANTS=40 plants more of each kind.
#include "models/training/audit/opened_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <set>

#include "io/files/safetensors.h"
#include "models/training/audit/ledger.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

void flip(real& value, std::uint32_t bit) {
  value = std::bit_cast<real>(std::bit_cast<std::uint32_t>(value) ^ (1U << bit));
}

/// With one bit of one entry of a tensor flipped.
void flip_in_file(const std::string& path, const std::string& tensor, std::size_t entry, std::uint32_t bit) {
  const SafetensorsFile file = SafetensorsFile::read(path);
  std::vector<TensorToWrite> tensors;
  std::vector<float> values = file.f32(tensor);
  flip(values[entry], bit);
  for (const auto& [name, info] : file.tensors())
    tensors.push_back(
        {name, info.dtype, info.shape, name == tensor ? std::as_bytes(std::span(values)) : file.bytes(name)});
  write_safetensors(path, file.metadata(), tensors);
}

std::optional<Dim> first_different_entry(const Tensor& one, const Tensor& other) {
  for (Dim i = 0; one.size() == other.size() && i < one.size(); ++i)
    if (std::bit_cast<std::uint32_t>(one.data()[i]) != std::bit_cast<std::uint32_t>(other.data()[i]))
      return i;
  return std::nullopt;
}

/// The first array in which two openings of a step part, and the operator that has it.
struct Difference {
  std::string name, one, other;
};
std::optional<Difference> first_difference(const OpenedStep& one, const OpenedStep& other) {
  for (std::size_t i = 0; i < one.operators.size(); ++i)
    for (const char* field : {"inputs", "outputs"}) {
      const auto &mine = one.operators[i], &its = other.operators[i];
      for (std::size_t k = 0; mine.contains(field) && k < mine[field].size(); ++k)
        if (mine[field][k] != its[field][k]) return Difference{mine["name"], mine[field][k], its[field][k]};
    }
  return std::nullopt;
}

using Keep = std::optional<std::string>;

class OpenedSteps : public testing::Test {
 protected:
  static constexpr std::int64_t kStep = 3;

  OpenedSteps() {
    Trainer trainer = small_.trainer();
    while (trainer.step() < kStep - 1) trainer.train_step();
    trainer.save(state(), {});
    right_ = opened(small_.windows);
  }
  std::string state() const { return folder_.file("state.safetensors"); }
  OpenedStep opened(const WindowSet& windows, const Keep& keep = {}) const {
    Trainer trainer(windows, all_of(windows), Objective(windows, small_.recipe));
    trainer.restore(state(), {});
    return open_step(trainer, keep);
  }
  /// The names of those that `wants` holds of.
  std::vector<std::string> operators(const auto& wants) const {
    std::vector<std::string> names;
    for (const auto& ran : right_.operators)
      if (wants(ran)) names.push_back(ran["name"]);
    return names;
  }

  /// Where the step opened with a plant first differs from right_: the operator, the entry, and the bits of
  /// it.
  struct Found {
    std::string name;
    Dim entry;
    std::uint32_t bits;
  };
  std::optional<Found> found(const std::function<OpenedStep(const Keep& keep)>& planted) const {
    const auto at = first_difference(right_, planted({}));
    if (!at) return std::nullopt;
    const Tensor one = opened(small_.windows, at->name).arrays.at(at->one),
                 other = planted(at->name).arrays.at(at->other);
    const Dim entry = first_different_entry(one, other).value();
    return Found{
        at->name, entry,
        std::bit_cast<std::uint32_t>(one.data()[entry]) ^ std::bit_cast<std::uint32_t>(other.data()[entry])};
  }

  static int plants() {
    const char* wanted = std::getenv("SUPERTAC_PLANTS");
    return wanted != nullptr ? std::atoi(wanted) : 2;
  }
  std::size_t below(std::size_t n) {
    return static_cast<std::size_t>(random_.uniform(next_++) * static_cast<double>(n));
  }
  std::uint32_t random_bit() { return static_cast<std::uint32_t>(below(23)); }
  std::string one_of(const std::vector<std::string>& names) { return names[below(names.size())]; }

  const TemporaryFolder folder_;
  const SmallTraining small_;
  const RandomStream random_{11, 0};
  std::uint64_t next_ = 0;
  OpenedStep right_;
};

TEST_F(OpenedSteps, AreStepsLikeAnyOther) {
  Trainer plain = small_.trainer(), watched = small_.trainer();
  LedgerWriter of_plain(plain, 1), of_watched(watched, 1);
  for (int step = 1; step <= 3; ++step) {
    plain.train_step();
    const OpenedStep opened = open_step(watched);
    EXPECT_EQ(opened.step, step);
    const LedgerLine line = *of_watched.after_step();
    EXPECT_EQ(line.chain, of_plain.after_step()->chain);
    // What the updates made is what the line says: its parameters first, then the two moments of each.
    std::vector<std::string> parameters, moments;
    for (const auto& ran : opened.operators) {
      if (!ran["name"].get<std::string>().starts_with("update/")) continue;
      parameters.push_back(ran["outputs"][0].get<std::string>().substr(0, 64));
      for (const int k : {1, 2}) moments.push_back(ran["outputs"][k].get<std::string>().substr(0, 64));
    }
    parameters.insert(parameters.end(), moments.begin(), moments.end());
    EXPECT_EQ(parameters, line.tensors);
  }
}

TEST_F(OpenedSteps, EveryInputWasMadeBeforeOrIsAConstant) {
  std::set<std::string> made;
  std::size_t inputs = 0, constants = 0, unmade = 0;
  for (const auto& ran : right_.operators) {
    if (ran.contains("inputs"))
      for (const std::string input : ran["inputs"]) ++inputs, constants += !made.contains(input);
    if (ran.contains("gy")) {
      EXPECT_TRUE(made.contains(ran["y"])) << ran;
      unmade += !made.contains(ran["gy"]);
    }
    for (const std::string output : ran["outputs"]) made.insert(output);
  }
  EXPECT_GT(inputs, 1000U);
  EXPECT_LT(constants, inputs / 20);
  EXPECT_LE(unmade, 8U);  // dL/dL of each micro-batch, which is 1
}

// The entry is not compared: a file has another order of axes.
TEST_F(OpenedSteps, AFlippedBitOfTheStateIsFound) {
  const std::string kept = file_text(state());
  for (const bool moment : {false, true}) {
    const std::vector<std::string> tensors = operators([&](const auto& ran) {
      return ran["op"] == "state" &&
             ran["name"].template get<std::string>().starts_with("state/optimizer.") == moment;
    });
    for (int plant = 0; plant < plants(); ++plant) {
      const std::string name = one_of(tensors), tensor = name.substr(std::string("state/").size());
      const std::size_t entry = below(SafetensorsFile::read(state()).f32(tensor).size());
      const std::uint32_t bit = random_bit();
      const auto at = found([&](const Keep& keep) {
        flip_in_file(state(), tensor, entry, bit);
        const OpenedStep step = opened(small_.windows, keep);
        write_file(state(), kept);
        return step;
      });
      ASSERT_TRUE(at) << name;
      EXPECT_EQ(at->name, name);
      EXPECT_EQ(at->bits, 1U << bit) << name;
    }
  }
}

TEST_F(OpenedSteps, AnotherSampleIsFoundWithItsMicroBatch) {
  const auto batch = std::ranges::find(right_.operators, "batch", [](const auto& ran) { return ran["op"]; });
  const std::vector<std::uint32_t> examples = (*batch)["examples"];
  for (int plant = 0; plant < plants();) {
    const std::size_t pass = below(2), frame = below(150);
    const auto holds = [&](std::uint32_t i) {
      const std::size_t last = small_.windows.frame_of(i);
      return small_.windows.pass_of(i) == pass && frame <= last && last - frame < small_.windows.frames();
    };
    const auto slot = std::ranges::find_if(examples, holds) - examples.begin();
    if (slot == std::ssize(examples)) continue;
    const WindowSet other = small_windows(small_.recipe.model, 150, [&](Recording& r) {
      if (r.trial == static_cast<int>(pass) + 1) r.signals[frame * rig::kTaxels] = 2.0F;
    });
    const auto at = found([&](const Keep& keep) { return opened(other, keep); });
    ASSERT_TRUE(at);
    EXPECT_EQ(at->name, std::to_string(slot) + "/windows");  // eight micro-batches of one example
    ++plant;
  }
}

}  // namespace
}  // namespace supertac
