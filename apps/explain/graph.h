// The graph of one training step as a picture: every op with its shape, bytes, parameters, values and
// gradients (of single numbers themselves, of more their norms), and the time of both its steps.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "autograd/variable.h"
#include "io/files/file.h"
#include "layers/module.h"

namespace supertac {

/// Runs `loss` forward and backward and returns the graph as Graphviz's text. Parameters are part of the op
/// that they go into, each with its whole gradient wherever it is used. `parameters` is read after `loss` has
/// run, so `loss` may be what fills it, as an expression does. Throws what `loss` and backward() throw.
std::string graph_of(const std::function<Variable()>& loss, const std::vector<Parameter>& parameters);

/// Writes it: FILE.dot, or by Graphviz's program dot FILE.svg. Throws FileError, std::invalid_argument for
/// another ending.
void write_graph(const OutputPath& output, const std::string& dot);

}  // namespace supertac
