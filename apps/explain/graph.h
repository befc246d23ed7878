// The graph of one training step as a picture: every op with its shape, parameters, bytes, norms of value and
// gradient, and the time of its reverse step.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "autograd/variable.h"
#include "layers/module.h"

namespace supertac {

/// Runs `loss` forward and backward and returns the graph as Graphviz's text. Parameters are part of the op
/// that they go into.
std::string graph_of(const std::function<Variable()>& loss, const std::vector<Parameter>& parameters);

/// Writes it: FILE.dot, or by Graphviz's program dot FILE.svg. Throws FileError, std::invalid_argument for
/// another ending.
void write_graph(const std::string& path, const std::string& dot);

}  // namespace supertac
