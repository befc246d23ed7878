// A small training on simulated data, for tests of what becomes of it.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tests/apps/common/simulated_data.h"

namespace supertac {

class Training : public OnSimulatedData {
 protected:
  static std::vector<std::string> options(const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> all{"--data",   path("data"), "--out",   path(out), "--timesteps", "32",
                                 "--latent", "3",          "--scale", "2",       "--batch",     "8"};
    if (std::find(more.begin(), more.end(), "--stride") == more.end())
      all.insert(all.end(), {"--stride", "8"});
    if (std::find(more.begin(), more.end(), "--epochs") == more.end())
      all.insert(all.end(), {"--epochs", "2"});
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  static ProcessResult train(const std::string& out, std::vector<std::string> more = {}) {
    return run_process("supertac-train", options(out, std::move(more)));
  }
};

}  // namespace supertac
