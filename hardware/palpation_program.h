#pragma once

#include <string>

#include "hardware/limits.h"
#include "hardware/palpation.h"

namespace supertac {

/// The palpation run as G-code, for people who send it from another host: the moves of Palpation::run, in
/// the same lines, with M400 behind each. It begins with a pause (M0) in which the operator confirms that the
/// head is at `origin`, then sets the coordinates (G92): what a host of ours asks before it moves. All
/// coordinates are absolute, in mm; between passes and at the end the finger is lifted, and the head returns
/// to the origin.
/// `title`: one line for the reader
/// Throws OutsideLimits when a target or the way to it is not allowed; std::invalid_argument for a plan that
/// makes no sense or a title with a line break
std::string palpation_program(const PalpationPlan& plan, const Point3& origin, const Limits& limits,
                              const std::string& title);

}  // namespace supertac
