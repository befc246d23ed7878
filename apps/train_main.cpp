// supertac-train: recordings in, a model out.
#include "apps/common/command_line/program.h"
#include "apps/ranks/together.h"
#include "apps/train/training_options.h"
#include "apps/train/training_run.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("data", "DIR", "recordings to train on (supertac-simulate, -import, -collect)");
  a.required("out", "FILE",
             "the model; FILE's run folder beside it (.run) holds log, report and the state to resume")
      .writes();
  a.option("resume", "FILE", "continue from the last.safetensors of an interrupted run, same options");
  a.option("seed", "N", "of split, initial weights, order, noise", "0");
  declare_training(a);
}

int run(Arguments& a) {
  return together(a, [&](Ranks& ranks) { return train(a, ranks); });
}

}  // namespace supertac
