#include "apps/explain/graph.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "apps/common/running/signals.h"
#include "autograd/kernels/sums.h"
#include "autograd/reverse_watch.h"
#include "autograd/trace.h"

namespace supertac {
namespace {

constexpr int kPatienceS = 120;  // of the largest network's graph dot makes a drawing in seconds
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 30;

double norm(const Tensor& t) { return std::sqrt(kernels::sum_of_squares(t.size(), t.data())); }

std::string number(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// A single value as it is, of more the norm.
std::string said(const std::string& name, const Tensor& t) {
  return t.size() == 1 ? name + " " + number("%.4g", t.data()[0])
                       : "|" + name + "| " + number("%.3g", norm(t));
}

struct Reverse {
  std::string gradient{};
  double us = 0;
};

class Clock : public ReverseWatch {
 public:
  void reverse(const char*, std::size_t, Backward& b, const std::function<void()>& step) override {
    Reverse& r = of_[&b.node()];
    r.gradient = said("g", b.gy());
    const auto begin = std::chrono::steady_clock::now();
    step();
    r.us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
  }
  const std::map<const detail::Node*, Reverse>& of() const { return of_; }

 private:
  std::map<const detail::Node*, Reverse> of_;
};

std::string label(const TracedOp& op, const std::map<const real*, const Parameter*>& parameters,
                  const std::map<const detail::Node*, Reverse>& reverse) {
  // Bytes and times of single numbers say nothing.
  const bool of_numbers =
      op.y.size() == 1 && std::ranges::all_of(op.inputs, [](const Variable& x) { return x.size() == 1; });
  std::string text = std::string(op.op) + " " + op.y.shape().text();
  if (!of_numbers) text += "\\n" + number("%.1f kB", static_cast<double>(op.y.size()) * sizeof(real) / 1000);
  for (const Variable& x : op.inputs) {
    const auto p = parameters.find(x.value().data());
    if (p == parameters.end()) continue;
    text += "\\n" + p->second->name + " " + x.shape().text() + " " + said("value", x.value());
    if (x.grad().defined()) text += "  " + said("g", x.grad());
  }
  text += "\\n" + said("y", op.y.value());
  const auto r = reverse.find(op.y.node());
  if (r != reverse.end()) text += "  " + r->second.gradient;
  if (of_numbers) return text;
  text += "\\n" + number("%.0f us", op.us);
  if (r != reverse.end()) text += " forward, " + number("%.0f us", r->second.us) + " back";
  return text;
}

// Its status; -1 of a program that did not end in time. A signal ends it, and the wait.
int wait_for(pid_t child) {
  int status = -1;
  for (int i = 0; i < kPatienceS * 100 && !interrupted(); ++i) {
    if (::waitpid(child, &status, WNOHANG) != 0) return status;
    ::usleep(10'000);
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, &status, 0);
  stop_if_interrupted();
  return -1;
}

}  // namespace

std::string graph_of(const std::function<Variable()>& loss, const std::vector<Parameter>& parameters) {
  Trace trace;
  const Variable total = loss();
  std::map<const real*, const Parameter*> known;
  for (const Parameter& p : parameters) known[p.value.value().data()] = &p;
  Clock clock;
  backward(total);
  std::string text = "digraph step {\n  rankdir=TB; node [shape=box, fontname=\"Helvetica\", fontsize=10];\n";
  std::map<const real*, std::size_t> maker;
  const std::vector<TracedOp>& ops = trace.ops();
  for (std::size_t i = 0; i < ops.size(); ++i) {
    text += "  n" + std::to_string(i) + " [label=\"" + label(ops[i], known, clock.of()) + "\"];\n";
    for (const Variable& x : ops[i].inputs) {
      const auto from = maker.find(x.value().data());
      if (from != maker.end())
        text += "  n" + std::to_string(from->second) + " -> n" + std::to_string(i) + ";\n";
    }
    maker[ops[i].y.value().data()] = i;
  }
  return text + "}\n";
}

void write_graph(const OutputPath& output, const std::string& dot) {
  if (output.path.ends_with(".dot")) return write_file(output, dot);
  if (!output.path.ends_with(".svg"))
    throw std::invalid_argument("expected FILE.dot or FILE.svg, found " + output.path);
  std::string folder = output.path + ".XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr)
    throw FileError(output.path, "cannot write beside it; choose another place");
  const std::string source = folder + "/graph.dot", drawn = folder + "/graph.svg";
  int status = -1;
  try {
    write_file(source, dot);
    const pid_t child = ::fork();
    if (child == 0) {
      ::execlp("dot", "dot", "-Tsvg", source.c_str(), "-o", drawn.c_str(), static_cast<char*>(nullptr));
      ::_exit(127);
    }
    if (child > 0) status = wait_for(child);
    if (status == 0) write_file(output, read_text_file(drawn, kMostBytes));
  } catch (...) {
    std::filesystem::remove_all(folder);
    throw;
  }
  std::filesystem::remove_all(folder);
  if (status != 0)
    throw FileError(output.path, "dot of Graphviz did not draw it within " + std::to_string(kPatienceS) +
                                     " s; install graphviz, or ask for FILE.dot");
}

}  // namespace supertac
