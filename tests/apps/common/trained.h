// A small training on simulated data, for tests of what becomes of it.
#pragma once

#include <string>

#include "tests/apps/common/simulated_data.h"

namespace supertac {

class Training : public OnSimulatedData {
 protected:
  /// Of a small model in seconds; an option that is given again replaces the one before.
  static std::string options(const std::string& out, const std::string& more = "") {
    return " --data data --out " + out +
           " --timesteps 32 --latent 3 --scale 2 --batch 8 --stride 8 --epochs 2 " + more;
  }
  static ProcessResult train(const std::string& out, const std::string& more = "") {
    return run("supertac-train" + options(out, more));
  }
  /// train() that has to succeed.
  static ProcessResult trained(const std::string& out, const std::string& more = "") {
    return succeed("supertac-train" + options(out, more));
  }
};

}  // namespace supertac
