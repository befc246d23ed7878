// supertac-evaluate: how good a model is on a data set, beside what does without a network.
#include "apps/common/command_line/program.h"
#include "apps/common/output/remarks.h"
#include "apps/evaluate/pairs.h"
#include "apps/evaluate/recordings.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "a model written by supertac-train; of several the pictures are averaged");
  a.option("data", "DIR", "recordings to test on");
  a.option("pairs", "FILE", "instead of --data: pairs to test a model trained with --pairs on");
  a.one_of({"data", "pairs"});
  a.option("split", "NAME",
           "window, pass, trial, texture, group or none; with --pairs group, pair or none (default: the "
           "model's own); its test side is scored");
  a.option("seed", "N", "of the split (default: the model's own)");
  a.option("limit", "N", "score at most N examples, evenly spread; 0 = all", "0");
  a.option("precision", "NAME", "fp32, or int8: products of bytes, faster on processors with AVX-512 VNNI",
           "fp32");
  a.option("batch", "N", "examples that are drawn at once; their pictures do not depend on it", "64");
  a.decides_nothing();
  a.option("outputs", "FILE",
           "write inputs as the network takes them, outputs, truths and predicted errors as safetensors");
  declare_strict(a);
  a.only_with("data");
  a.option("plates", "A,B,...", "only recordings of these plates (default: the model's own)");
  a.option(
      "pictures", "DIR",
      "write PNG pictures: input | output | truth | how far off it may be, and a film of each test pass");
  a.option("report", "FILE",
           "write one page with scores, the best and worst windows and a film of each test pass (HTML)");
  a.option("write-pairs", "DIR",
           "write the split's windows as pairs for networks that know no time (supertac-train --pairs): "
           "train.safetensors and test.safetensors with the last frame as the model sees it, and the truth");
}

int run(Arguments& a) { return a.given("pairs") ? evaluate_on_pairs(a) : evaluate_on_recordings(a); }

}  // namespace supertac
