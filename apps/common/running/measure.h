// What a picture costs on this machine.
#pragma once

#include <functional>

#include <nlohmann/json.hpp>

namespace supertac {

struct Latency {
  double median_us = 0, p99_us = 0;
  nlohmann::ordered_json to_json() const { return {{"median_us", median_us}, {"p99_us", p99_us}}; }
};

/// Processor time of calls that make one picture each (batch 1, one thread), warm: what a clock on the wall
/// shows on an idle machine, without the turns that other programs take on a busy one.
Latency measure_latency(const std::function<void()>& make_picture);

}  // namespace supertac
