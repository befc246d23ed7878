// The command line of a program: its options are declared, parsed (cxxopts), and read with range checks.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/file.h"

namespace supertac {

/// The command line is wrong: exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What work() returns; an std::invalid_argument of it becomes a UsageError with `before` in front.
template <class Work>
auto as_usage(Work work, const std::string& before = "") {
  try {
    return work();
  } catch (const std::invalid_argument& error) {
    throw UsageError(before + error.what());
  }
}
/// The same, naming the option.
template <class Work>
auto read_option(const std::string& option, Work work) {
  return as_usage(work, "--" + option + ": ");
}

/// How many threads a program takes when none are asked for: what OpenMP says (OMP_NUM_THREADS, else the
/// processors of the affinity mask), at most the cgroup's CPU quota rounded up.
int default_threads();

/// The quota in a cgroup's cpu.max ("200000 100000", "max 100000"), in processors rounded up; nullopt when
/// there is none or the text cannot be read.
std::optional<int> quota_of_cpu_max(std::string_view text);

/// A file or folder that the command line names.
struct NamedPath {
  std::string option, path;
  bool is_output = false, is_folder = false;
};

/// Options of one program. Every program also has --help, --version, --json, --quiet, --threads and --force.
class Arguments {
 public:
  Arguments(std::string program, std::string purpose);

  // Declaring. `value` names what is expected, with its unit ("DIR", "N", "MM_PER_S"); help is a short
  // clause.

  /// An argument without a name, in the order of declaration.
  Arguments& positional(const std::string& value, const std::string& help, bool is_required = true) {
    return declare(value, {.value = value, .help = help, .is_required = is_required, .is_positional = true});
  }
  /// An option that has to be given.
  Arguments& required(const std::string& name, const std::string& value, const std::string& help) {
    return declare(name, {.value = value, .help = help, .is_required = true});
  }
  /// An option with a default; "" means not given.
  Arguments& option(const std::string& name, const std::string& value, const std::string& help,
                    const std::string& default_value = "") {
    return declare(name, {.value = value, .help = help, .default_value = default_value});
  }
  /// The same, but `alone` is its value where it is given without one.
  Arguments& option_alone(const std::string& name, const std::string& value, const std::string& help,
                          const std::string& alone) {
    return declare(name, {.value = "[" + value + "]", .help = help, .alone = alone});
  }
  Arguments& flag(const std::string& name, const std::string& help) {
    return declare(name, {.help = help, .is_flag = true});
  }
  /// The options declared from here on say something beside `option` only and are refused without it; "" ends
  /// this.
  Arguments& only_with(const std::string& option) { return only_with_ = option, *this; }
  /// The option declared last names what is written; '-' is stdout.
  Arguments& writes() { return options_.at(order_.back()).writes = true, *this; }
  /// The option declared last changes no byte of what is made, so its provenance does not name it.
  Arguments& decides_nothing() { return options_.at(order_.back()).decides = false, *this; }
  /// The options declared from here on stand under "more options" in the help: few people need them.
  Arguments& more(bool on = true) { return more_ = on, *this; }

  /// Throws UsageError: an unknown option (naming the nearest known one), a value missing, an argument too
  /// many or too few, an option that says nothing beside the others. --help and --version may stand without
  /// what is required.
  void parse(int argc, const char* const* argv);

  // Reading; `name` is that of an option or the value name of a positional argument. All throw UsageError
  // that names option, expected and found.

  bool given(const std::string& name) const;  ///< on the command line
  bool flag(const std::string& name) const { return given(name); }
  std::string text(const std::string& name) const;
  /// One of the given words.
  std::string choice(const std::string& name, const std::vector<std::string>& words) const;
  std::int64_t integer(const std::string& name, std::int64_t lowest, std::int64_t highest) const;
  double number(const std::string& name, double lowest, double highest) const;
  /// --seed, from 0 on.
  std::uint64_t seed() const;
  /// Comma-separated; an empty value is an empty list, an empty element is an error, and so is one given
  /// twice.
  std::vector<std::string> list(const std::string& name) const;
  std::vector<double> numbers(const std::string& name, double lowest, double highest) const;

  /// All files and folders named; what an option may name but does not hold is left out.
  std::vector<NamedPath> paths() const;

  bool force() const { return flag("force"); }

  /// A file or folder to be written, of the option `name`: what has its name is replaced under --force only.
  /// Otherwise what was made gets another name, the user is told, and the program fails at its end.
  OutputPath output(const std::string& name) const;
  /// Whether that has happened.
  bool displaced() const { return displaced_; }
  bool quiet() const { return muted_ || flag("quiet"); }
  /// --threads, or default_threads().
  int threads() const;

  const std::string& program() const { return program_; }
  /// The whole command line, words quoted as a shell takes them, for a run's settings.
  const std::string& command_line() const { return command_line_; }
  /// Program and options that decide what it makes, in the order of declaration: no files and folders, and
  /// nothing of how it is computed, shown or kept.
  std::string deciding_options() const;
  bool declares(const std::string& name) const { return options_.contains(name); }
  std::string help() const;

  // Talking.

  /// From here on nothing of this is said or written, as if under --quiet: another process does it.
  void mute() { muted_ = true; }
  /// A line of the result for a reader, on stdout; nothing when the JSON goes there.
  void print(std::string_view line) const;
  /// A remark on stderr; nothing under --quiet.
  void note(std::string_view line) const;
  /// The machine-readable result and its provenance, to where --json says: a file (atomically) or, for '-',
  /// stdout. Without --json nothing.
  void write_json(const nlohmann::ordered_json& result) const;

 private:
  struct Option {
    std::string value{}, help{}, default_value{};
    bool is_flag = false, is_required = false, is_positional = false;
    bool is_more = false, decides = true, writes = false;
    std::string only_with{}, alone{};
  };

  Arguments& declare(const std::string& name, Option option);
  std::vector<std::string> complete_words(int argc, const char* const* argv) const;
  void check_given() const;
  [[noreturn]] void refuse_option(const std::string& name) const;
  [[noreturn]] void reject(const std::string& name, const std::string& expected,
                           const std::string& found) const;

  std::string program_, purpose_, command_line_;
  std::vector<std::string> order_;        // of declaration
  std::vector<std::string> positionals_;  // value names
  std::map<std::string, Option> options_;
  std::string only_with_;  // of the options being declared
  bool more_ = false, muted_ = false;
  mutable bool displaced_ = false;
  std::map<std::string, std::string> values_;  // as given
};

}  // namespace supertac
