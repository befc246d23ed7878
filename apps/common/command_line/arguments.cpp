#include "apps/common/command_line/arguments.h"

#include <omp.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cxxopts.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <set>

#include "apps/common/output/provenance.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

/// The options as cxxopts wants them; everything is text there, numbers are read locale-free afterwards.
void add(cxxopts::Options& parser, const std::string& name, const auto& option) {
  const std::string names = name == "help" ? "h,help" : name, group = option.is_more ? "more" : "";
  const auto text = cxxopts::value<std::string>();
  if (!option.default_value.empty()) text->default_value(option.default_value);
  option.is_flag ? parser.add_options(group)(names, option.help)
                 : parser.add_options(group)(names, option.help, text, option.value);
}

// The values that may name a file or folder.
constexpr std::array<std::string_view, 5> kPathValues = {"FILE", "DIR", "JOURNAL", "INPUT", "NAME"};

bool names_path(const std::string& value) {
  return std::any_of(kPathValues.begin(), kPathValues.end(),
                     [&](std::string_view kind) { return value.starts_with(kind); });
}

// Names and messages may hold what a terminal obeys.
std::string without_controls(std::string_view line) {
  std::string text(line);
  std::replace_if(
      text.begin(), text.end(),
      [](unsigned char c) { return (c < ' ' && c != '\t' && c != '\n') || c == 0x7F; }, '?');
  return text;
}

// The word as a shell takes it: in single quotes where it holds more than letters, digits and -_./,:=+%@.
std::string quoted_word(std::string_view word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./,:=+%@";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string_view::npos) return std::string(word);
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// Restricted Damerau-Levenshtein distance: of the first i and j letters, in a table.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector table(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      std::size_t& least = table[i][j] = i + j;
      if (i == 0 || j == 0) continue;
      least =
          std::min({table[i - 1][j] + 1, table[i][j - 1] + 1, table[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) least = std::min(least, table[i - 2][j - 2] + 1);
    }
  return table.back().back();
}

/// The candidate with the fewest single-letter changes (insert, delete, replace, swap of neighbours) from
/// `name`; empty when none is near: at most a third of its letters, at least two, may differ. Among equals,
/// one that begins with `name`.
std::string nearest_name(const std::string& name, const std::vector<std::string>& candidates) {
  std::string nearest;
  std::size_t fewest = name.size();  // a name all of whose letters differ is no hint
  constexpr std::size_t kLongest = 64;
  if (name.empty() || name.size() > kLongest) return nearest;
  for (const std::string& candidate : candidates) {
    const std::size_t changes = distance(name, candidate);
    const bool nearer = changes < fewest || (changes == fewest && candidate.starts_with(name));
    if (!nearer || changes > std::max<std::size_t>(2, candidate.size() / 3)) continue;
    fewest = changes;
    nearest = candidate;
  }
  return nearest;
}

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// Version 2 of cgroups: the group's own limit and that of the root of its namespace.
int quota() {
  int lowest = 1 << 20;
  const std::string group = first_line("/proc/self/cgroup");  // "0::/path"
  const std::string path = group.starts_with("0::") ? group.substr(3) : "";
  for (const std::string& folder : {"/sys/fs/cgroup" + path, std::string("/sys/fs/cgroup")}) {
    if (const auto limit = quota_of_cpu_max(first_line(folder + "/cpu.max")))
      lowest = std::min(lowest, *limit);
  }
  return lowest;
}

}  // namespace

std::optional<int> quota_of_cpu_max(std::string_view text) {
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos) return std::nullopt;
  const auto limit = parse_int(text.substr(0, space));
  const auto period = parse_int(text.substr(space + 1));
  if (!limit || !period || *limit <= 0 || *period <= 0) return std::nullopt;
  return static_cast<int>(std::clamp<std::int64_t>((*limit + *period - 1) / *period, 1, 1 << 20));
}

int default_threads() { return std::min(omp_get_max_threads(), quota()); }

Arguments::Arguments(std::string program, std::string purpose)
    : program_(std::move(program)), purpose_(std::move(purpose)) {
  flag("help", "print this and exit; supertac help glossary explains the words");
  flag("version", "print version, commit, compiler and exit");
  option("json", "FILE", "also write the results as JSON; '-' is stdout").writes();
  flag("quiet", "no progress bar and no remarks").decides_nothing();
  option("threads", "N", "worker threads; default OMP_NUM_THREADS, else what the machine grants")
      .decides_nothing();
  flag("force", "replace existing output").decides_nothing();
}

Arguments& Arguments::declare(const std::string& name, Option option) {
  option.only_with = only_with_;
  option.is_more = more_;
  if (option.is_positional) positionals_.push_back(name);
  if (!options_.emplace(name, std::move(option)).second)
    throw std::invalid_argument("Arguments: option " + name + " declared twice");
  order_.push_back(name);
  return *this;
}

std::string Arguments::help() const {
  cxxopts::Options parser(program_, purpose_);
  std::string usage;
  for (const std::string& name : positionals_)
    usage += options_.at(name).is_required ? name + " " : "[" + name + "] ";
  for (const std::string& name : order_) {
    const Option& option = options_.at(name);
    if (option.is_required && !option.is_positional) usage += "--" + name + " " + option.value + " ";
  }
  parser.custom_help(usage + "[options]");
  // A program's own options first, then those that all have, up to --force.
  const auto common =
      static_cast<std::size_t>(std::find(order_.begin(), order_.end(), "force") - order_.begin()) + 1;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::string& name = order_[(i + common) % order_.size()];
    const Option& option = options_.at(name);
    if (!option.is_positional) add(parser, name, option);
  }
  std::string text = parser.help();
  for (const std::string& name : positionals_) text += "\n  " + name + ": " + options_.at(name).help;
  return text + (positionals_.empty() ? "" : "\n");
}

/// The command line with the values of options that stand alone. Throws for an option that there is not:
/// cxxopts takes such a word for a value or a file.
std::vector<std::string> Arguments::complete_words(int argc, const char* const* argv) const {
  std::vector<std::string> words;
  bool ended = false;  // by "--"
  for (int i = 0; i < argc; ++i) {
    const std::string word = words.emplace_back(argv[i]);
    ended = ended || (i > 0 && word == "--");
    if (i == 0 || ended || !word.starts_with("--")) continue;
    const std::string name = word.substr(2, word.find('=') - 2);
    const auto found = options_.find(name);
    if (found == options_.end() || found->second.is_positional) refuse_option(name);
    if (found->second.alone.empty() || name.size() + 2 < word.size()) continue;
    if (i + 1 == argc || std::string_view(argv[i + 1]).starts_with("--"))
      words.push_back(found->second.alone);
  }
  return words;
}

void Arguments::refuse_option(const std::string& name) const {
  std::vector<std::string> known;
  for (const auto& [other, option] : options_)
    if (!option.is_positional) known.push_back(other);
  const std::string hint = nearest_name(name, known);
  throw UsageError("unknown option " + in_quotes("--" + name) +
                   (hint.empty() ? "" : "; did you mean '--" + hint + "'?"));
}

void Arguments::parse(int argc, const char* const* argv) {
  for (int i = 0; i < argc; ++i) command_line_ += (i > 0 ? " " : "") + quoted_word(argv[i]);
  cxxopts::Options parser(program_, purpose_);
  for (const std::string& name : order_) add(parser, name, options_.at(name));
  parser.parse_positional(positionals_);
  try {
    const std::vector<std::string> words = complete_words(argc, argv);
    std::vector<const char*> pointers;
    for (const std::string& word : words) pointers.push_back(word.c_str());
    const cxxopts::ParseResult result = parser.parse(static_cast<int>(pointers.size()), pointers.data());
    for (const std::string& name : order_) {
      if (result.count(name) == 0) continue;
      values_[name] = options_.at(name).is_flag ? "" : result[name].as<std::string>();
    }
    if (!result.unmatched().empty())
      throw UsageError("unexpected argument " + in_quotes(result.unmatched().front()));
  } catch (const cxxopts::exceptions::exception& error) {
    throw UsageError(error.what());
  }
  if (given("help") || given("version")) return;
  check_given();
}

void Arguments::check_given() const {
  for (const std::string& name : order_) {
    const Option& option = options_.at(name);
    const bool is_given = given(name), is_empty = is_given && !option.is_flag && values_.at(name).empty();
    if (option.is_required && (!is_given || is_empty))
      throw UsageError("missing " + (option.is_positional ? name : "--" + name + " " + option.value) + ": " +
                       option.help);
    // An empty name is a variable that was not set, not a wish to leave the option out.
    if (is_empty && names_path(option.value))
      throw UsageError("--" + name + ": expected " + option.value + ", found an empty name");
    if (is_given && !option.only_with.empty() && !given(option.only_with))
      throw UsageError("--" + name + ": only with --" + option.only_with +
                       ", which is not given; leave it out");
  }
}

std::vector<NamedPath> Arguments::paths() const {
  std::vector<NamedPath> paths;
  for (const auto& [name, text] : values_) {
    const Option& option = options_.at(name);
    if (option.is_flag || !names_path(option.value) || (option.writes && text == "-")) continue;
    const bool is_folder = option.value.ends_with("DIR");
    if (option.writes || is_folder) {
      paths.push_back({name, text, option.writes, is_folder});
      continue;
    }
    for (const std::string& path : comma_list(text)) {
      std::error_code error;
      // Of what has a name only plates lie in files; a folder that is called like a preset is nobody's.
      const bool may_lie_there =
          !option.value.starts_with("NAME") || path.ends_with(".stl") || path.ends_with(".STL");
      if (may_lie_there && std::filesystem::exists(path, error)) paths.push_back({name, path, false, false});
    }
  }
  return paths;
}

std::string Arguments::deciding_options() const {
  std::string line = program_;
  for (const std::string& name : order_) {
    const Option& option = options_.at(name);
    const bool is_path = option.value != "NAME" && names_path(option.value);
    if (!given(name) || is_path || !option.decides || name == "seed") continue;
    line += option.is_positional ? " " : " --" + name + (option.is_flag ? "" : " ");
    if (!option.is_flag) line += quoted_word(values_.at(name));
  }
  return line;
}

void Arguments::reject(const std::string& name, const std::string& expected, const std::string& found) const {
  throw UsageError("--" + name + ": expected " + expected + ", found " + in_quotes(found));
}

bool Arguments::given(const std::string& name) const {
  if (!options_.contains(name)) throw std::invalid_argument("Arguments: no option " + name);
  return values_.contains(name);
}

std::string Arguments::text(const std::string& name) const {
  return given(name) ? values_.at(name) : options_.at(name).default_value;
}

std::string Arguments::choice(const std::string& name, const std::vector<std::string>& words) const {
  const std::string word = text(name);
  if (std::ranges::find(words, word) != words.end()) return word;
  const std::string hint = nearest_name(word, words);
  throw UsageError("--" + name + ": expected one of " + joined(words, ", ") + ", found " + in_quotes(word) +
                   (hint.empty() ? "" : "; did you mean '" + hint + "'?"));
}

std::int64_t Arguments::integer(const std::string& name, std::int64_t lowest, std::int64_t highest) const {
  const auto value = parse_int(text(name));
  if (value && *value >= lowest && *value <= highest) return *value;
  reject(name, "a whole number from " + std::to_string(lowest) + " to " + std::to_string(highest),
         text(name));
}

std::uint64_t Arguments::seed() const {
  return static_cast<std::uint64_t>(integer("seed", 0, std::numeric_limits<std::int64_t>::max()));
}

double Arguments::number(const std::string& name, double lowest, double highest) const {
  const auto value = parse_double(text(name));
  if (value && *value >= lowest && *value <= highest) return *value;
  reject(name, "a number from " + format(lowest) + " to " + format(highest), text(name));
}

std::vector<std::string> Arguments::list(const std::string& name) const {
  std::set<std::string> seen;
  const std::string value = text(name);
  const std::vector<std::string> elements = comma_list(value);
  for (const std::string& element : elements) {
    if (trimmed(element).empty()) reject(name, "a list without empty elements", value);
    if (!seen.insert(element).second) reject(name, "every element once", value);
  }
  if (value.ends_with(',')) reject(name, "a list without empty elements", value);
  return elements;
}

std::vector<double> Arguments::numbers(const std::string& name, double lowest, double highest) const {
  std::vector<double> values;
  for (const std::string& element : list(name)) {
    const auto value = parse_double(element);
    if (!value || !(*value >= lowest && *value <= highest)) {
      reject(name, "numbers from " + format(lowest) + " to " + format(highest), element);
    }
    values.push_back(*value);
  }
  return values;
}

int Arguments::threads() const {
  return given("threads") ? static_cast<int>(integer("threads", 1, 1024)) : default_threads();
}

OutputPath Arguments::output(const std::string& name) const {
  if (force()) return text(name);
  return {text(name), [this](const std::string& line) {
            displaced_ = true;
            if (!muted_) std::cerr << program_ + ": " + without_controls(line) + "\n";
          }};
}

void Arguments::print(std::string_view line) const {
  if (!muted_ && text("json") != "-") std::cout << without_controls(line) << '\n';
}

void Arguments::note(std::string_view line) const {
  if (!quiet()) std::cerr << without_controls(line) << '\n';
}

void Arguments::write_json(const nlohmann::ordered_json& result) const {
  if (muted_ || !given("json")) return;
  nlohmann::ordered_json whole = result;
  if (whole.is_object() && !whole.contains("provenance")) whole["provenance"] = full_provenance();
  const std::string document = whole.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  if (text("json") == "-") {
    std::cout << document;
  } else {
    write_file(output("json"), document);
  }
}

}  // namespace supertac
