// An opened step: it changes nothing, ends in the ledger's line, and brings whatever is planted in it down to
// operator and entry. SUPERTAC_PLANTS=200 plants more.
#include "models/training/audit/opened_step.h"
#include "models/training/audit/step_difference.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdlib>
#include <map>
#include <set>

#include "autograd/kernels/conv.h"
#include "autograd/ops/linear.h"
#include "io/files/safetensors.h"
#include "models/training/audit/ledger.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

/// The same windows, two of them exchanged.
class Exchanged : public WindowSet {
 public:
  Exchanged(const WindowSet& of, std::uint32_t one, std::uint32_t other)
      : WindowSet(of), one_(one), other_(other) {}
  void window(std::size_t i, std::span<float> out) const override { WindowSet::window(at(i), out); }
  void truth(std::size_t i, std::span<float> out) const override { WindowSet::truth(at(i), out); }

 private:
  std::size_t at(std::size_t i) const { return i == one_ ? other_ : i; }
  std::size_t one_, other_;
};

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

/// What the op makes when the channels of its input are added up from the last to the first.
Tensor in_another_order(const TracedOp& op) {
  const Tensor &x = op.inputs[0].value(), &w = op.inputs[1].value(), &bias = op.inputs[2].value();
  const Dim cin = w.dim(w.rank() - 2), cout = w.dim(w.rank() - 1);
  Tensor from = x.clone(), weights = w.clone(), y(op.y.shape());
  for (Dim i = 0; i < x.size(); ++i) from.data()[i] = x.data()[i / cin * cin + cin - 1 - i % cin];
  for (Dim i = 0; i < w.size() / cout; ++i)
    std::copy_n(w.data() + (i / cin * cin + cin - 1 - i % cin) * cout, cout, weights.data() + i * cout);
  const real slope = op.settings.negative_slope;
  if (op.op == "linear") {
    kernels::linear(x.dim(0), cin, cout, from.data(), weights.data(), bias.data(), slope, y.data());
  } else {
    kernels::conv({op.settings.conv, x.dim(0), cin, cout}, from.data(), weights.data(), bias.data(), slope,
                  y.data());
  }
  return y;
}

class OpenedSteps : public testing::Test {
 protected:
  static constexpr std::int64_t kStep = 3;

  OpenedSteps() : windows_(small_windows(recipe_.model)) {
    Trainer trainer = trainer_on(windows_);
    while (trainer.step() < kStep - 1) trainer.train_step();
    trainer.save(state(), {});
  }
  std::string state() const { return folder_.file("state.safetensors"); }
  Trainer trainer_on(const WindowSet& windows) const {
    return {windows, all_of(windows_), Objective(windows_, recipe_)};
  }
  OpenedStep opened(const WindowSet& windows, const OpeningOptions& options = {}) const {
    Trainer trainer = trainer_on(windows);
    trainer.restore(state(), {});
    return open_step(trainer, options);
  }
  /// The operator in which the step, opened with and without the plant, differs; and the first entry, and the
  /// second's value.
  struct Found {
    OperatorDifference at;
    Dim entry = -1;
    real one = 0, other = 0;
  };
  std::optional<Found> found(const OpenedStep& right,
                             const std::function<OpenedStep(std::optional<std::string>)>& planted,
                             const std::function<OpenedStep(std::optional<std::string>)>& again) const {
    const auto at = first_difference(right.operators, planted({}).operators);
    if (!at) return std::nullopt;
    const OpenedStep one = again(at->name), other = planted(at->name);
    const auto x = one.arrays.find(at->one), y = other.arrays.find(at->other);
    if (x == one.arrays.end() || y == other.arrays.end()) return Found{*at};
    const Dim entry = first_different_entry(x->second, y->second).value_or(-1);
    return Found{*at, entry, x->second.data()[entry], y->second.data()[entry]};
  }

  const TemporaryFolder folder_;
  const Recipe recipe_ = small_training();
  const WindowSet windows_;
};

TEST_F(OpenedSteps, AreStepsLikeAnyOther) {
  Trainer plain = trainer_on(windows_), watched = trainer_on(windows_);
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
  const OpenedStep step = opened(windows_);
  std::set<std::string> made;
  std::size_t inputs = 0, constants = 0, unmade = 0;
  for (const auto& ran : step.operators) {
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

TEST_F(OpenedSteps, WhatIsPlantedIsFoundWithOperatorAndEntry) {
  const char* wanted = std::getenv("SUPERTAC_PLANTS");
  const int plants = wanted != nullptr ? std::atoi(wanted) : 10;
  const OpenedStep right = opened(windows_);
  const auto plain = [&](const auto& keep) { return opened(windows_, {.keep = keep}); };
  const RandomStream random(11, 0);
  std::uint64_t next = 0;
  const auto below = [&](std::size_t n) {
    return static_cast<std::size_t>(random.uniform(next++) * static_cast<double>(n));
  };
  const auto operators = [&](const auto& wants) {
    std::vector<std::string> names;
    for (const auto& ran : right.operators)
      if (wants(ran)) names.push_back(ran["name"]);
    return names;
  };
  const auto reversed =
      operators([](const auto& ran) { return ran.contains("gy") && ran["outputs"][0] != ""; });
  const auto products = operators([](const auto& ran) {
    return !ran.contains("gy") &&
           (ran["op"].template get<std::string>().starts_with("conv") || ran["op"] == "linear");
  });
  std::map<std::string, int> count;
  for (int plant = 0; plant < plants; ++plant) {
    const std::uint32_t bit = static_cast<std::uint32_t>(below(23));
    const std::string kind =
        std::array{"weight", "moment", "gradient", "sample", "order"}[static_cast<std::size_t>(plant) % 5];
    std::string name;
    std::size_t entry = 0;
    std::optional<Found> at;
    if (kind == "weight" || kind == "moment") {
      const auto& ran = right.operators[below(3 * trainer_on(windows_).model().parameters().size())];
      name = ran["name"];
      if (name.starts_with("state/optimizer.") != (kind == "moment")) {
        --plant;
        continue;
      }
      const std::string tensor = name.substr(6), kept = file_text(state());
      entry = below(SafetensorsFile::read(state()).f32(tensor).size());
      at = found(
          right,
          [&](const auto& keep) {
            flip_in_file(state(), tensor, entry, bit);
            const OpenedStep step = opened(windows_, {.keep = keep});
            write_file(state(), kept);
            return step;
          },
          plain);
      entry = static_cast<std::size_t>(at ? at->entry : 0);  // a file has another order of axes
    } else if (kind == "sample") {
      const std::vector<std::uint32_t> batch = [&] {
        for (const auto& ran : right.operators)
          if (ran["op"] == "batch") return ran["examples"].template get<std::vector<std::uint32_t>>();
        return std::vector<std::uint32_t>();
      }();
      const std::size_t slot = below(batch.size());
      const Exchanged other(windows_, batch[slot], static_cast<std::uint32_t>(below(windows_.size())));
      name = std::to_string(slot) + "/windows";  // eight micro-batches of one example
      at = found(
          right, [&](const auto& keep) { return opened(other, {.keep = keep}); }, plain);
      if (!at) {  // exchanged for itself
        --plant;
        continue;
      }
      entry = static_cast<std::size_t>(at->entry);
    } else {
      name = kind == "gradient" ? reversed[below(reversed.size())] : products[below(products.size())];
      const double where = random.uniform(next++);
      const auto planted = [&](const auto& keep) {
        return opened(
            windows_,
            {.keep = keep, .touch = [&](const auto& of, std::size_t index, const auto& op, Tensor& result) {
               if (of != name || index != 0) return;
               if (kind == "gradient") {
                 entry = static_cast<std::size_t>(where * static_cast<double>(result.size()));
                 return flip(result.data()[entry], bit);
               }
               const Tensor other = in_another_order(op);
               entry = static_cast<std::size_t>(first_different_entry(result, other).value_or(0));
               std::copy_n(other.data(), other.size(), result.data());
             }});
      };
      at = found(right, planted, plain);
      if (!at && kind == "order") {  // a sum that comes out the same
        --plant;
        continue;
      }
    }
    ASSERT_TRUE(at) << kind << " " << name;
    EXPECT_EQ(at->at.name, name) << kind;
    EXPECT_EQ(at->entry, static_cast<Dim>(entry)) << kind << " " << name;
    EXPECT_NE(std::bit_cast<std::uint32_t>(at->one), std::bit_cast<std::uint32_t>(at->other));
    if (kind != "order" && kind != "sample") {
      EXPECT_EQ(std::bit_cast<std::uint32_t>(at->one) ^ std::bit_cast<std::uint32_t>(at->other), 1U << bit)
          << kind << " " << name;
    }
    ++count[kind];
  }
  for (const auto& [kind, number] : count) RecordProperty(kind, number);
}

TEST_F(OpenedSteps, OtherNetworksAreRefused) {
  Recipe other = recipe_;
  other.model.channels = 4;
  Trainer trainer(windows_, all_of(windows_), Objective(windows_, other));
  OpenedStep fewer = opened(windows_), step = open_step(trainer);
  const auto difference = first_difference(fewer.operators, step.operators);
  ASSERT_TRUE(difference);
  EXPECT_EQ(difference->name, "state/encoder.0.conv.0.weight");  // of another training
  fewer.operators.erase(fewer.operators.begin());
  try {
    first_difference(fewer.operators, step.operators);
    FAIL() << "taken for the same";
  } catch (const std::invalid_argument& error) {
    EXPECT_TRUE(std::string(error.what())
                    .starts_with("opened steps: expected two of the same network and recipe, found "));
  }
}

}  // namespace
}  // namespace supertac
