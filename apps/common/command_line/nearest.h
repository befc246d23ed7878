#pragma once

#include <string>
#include <vector>

namespace supertac {

/// The candidate with the fewest single-letter changes (insert, delete, replace, swap of neighbours) from
/// `name`; empty when none is near: at most a third of its letters, at least two, may differ. Among equals,
/// one that begins with `name`.
std::string nearest_name(const std::string& name, const std::vector<std::string>& candidates);

}  // namespace supertac
