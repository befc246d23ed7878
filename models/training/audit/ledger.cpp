#include "models/training/audit/ledger.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include "io/files/file.h"
#include "io/files/json.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "supertac-ledger-2";
constexpr JsonLimits kLimits{.max_bytes = std::size_t{4} << 20};

constexpr std::string_view kChain = ",\"chain\":\"", kStep = "{\"step\":";

}  // namespace

std::string LedgerLine::text(bool with_chain) const {
  Json json{{"step", step}, {"batches", batches}, {"tensors", tensors}};
  if (with_chain) json["chain"] = chain;
  return json.dump();
}

LedgerLine LedgerLine::of(const std::string& text) {
  try {
    const Json json = parse_json_limited(text, kLimits);
    return {json.at("step").get<std::int64_t>(), json.at("batches").get<std::string>(),
            json.at("tensors").get<std::vector<std::string>>(), json.at("chain").get<std::string>()};
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("a ledger's line is damaged: ") + error.what());
  }
}

Ledger Ledger::read(const std::string& path) {
  const std::string none = "is no ledger of supertac-train --ledger, or damaged";
  std::ifstream in(path);
  if (!in) throw FileError(path, "cannot be read; train with --ledger N to have one");
  Ledger ledger;
  std::string text;
  std::getline(in, text);
  try {
    const Json header = parse_json_limited(text, kLimits);
    if (header.at("format") == "supertac-ledger-1")
      throw FileError(path, "has hashes of 64 bits, as version 0.1 wrote them; train again with --ledger N");
    if (header.at("format") != kFormat) throw FileError(path, none);
    ledger.every = header.at("every").get<std::int64_t>();
    ledger.names = header.at("tensors").get<std::vector<std::string>>();
  } catch (const Json::exception&) {
    throw FileError(path, none);
  } catch (const JsonError& error) {
    throw FileError(path, none + ": " + error.what());
  }
  if (ledger.every < 1) throw FileError(path, none);
  std::string chain = sha256(text);
  while (std::getline(in, text)) {
    if (in.eof()) break;  // torn off in the middle: the run was killed as it wrote
    // Without a look at its tensors: of a long training there are gigabytes.
    const std::size_t cut = text.rfind(kChain);
    Line line{0, text};
    if (!text.starts_with(kStep) || cut == std::string::npos ||
        std::from_chars(text.data() + kStep.size(), text.data() + cut, line.step).ec != std::errc())
      throw FileError(path, none);
    chain = sha256(chain + text.substr(0, cut) + "}");
    if (text.substr(cut + kChain.size()) != chain + "\"}")
      throw FileError(path, "step " + std::to_string(line.step) +
                                ": the chain is broken; a line was changed after it had been written");
    ledger.lines.push_back(std::move(line));
  }
  return ledger;
}

std::optional<LedgerLine> Ledger::at(std::int64_t step) const {
  const auto found = std::ranges::lower_bound(lines, step, {}, &Line::step);
  if (found == lines.end() || found->step != step) return std::nullopt;
  return LedgerLine::of(found->text);
}

static void for_each_of_state(const Trainer& trainer,
                              const std::function<void(const std::string&, const Tensor&)>& visit) {
  trainer.for_each_tensor(visit);
  if (!trainer.recipe().keeps_best) return;
  const std::vector<Parameter>& parameters = trainer.model().parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i)
    visit("optimizer.best." + parameters[i].name, trainer.best().empty() ? Tensor() : trainer.best()[i]);
}

std::vector<std::string> hashes_of(const Trainer& trainer) {
  std::vector<std::string> hashes;
  for_each_of_state(trainer, [&](const std::string&, const Tensor& values) {
    Sha256 hash;
    hash.add(std::as_bytes(values.values()));
    hashes.push_back(hash.hex());
  });
  return hashes;
}

LedgerWriter::LedgerWriter(const Trainer& trainer, std::int64_t every, const LedgerLine* previous)
    : trainer_(trainer), every_(every) {
  std::vector<std::string> names;
  for_each_of_state(trainer, [&](const std::string& name, const Tensor&) { names.push_back(name); });
  header_ = Json{{"format", kFormat}, {"every", every}, {"tensors", names}}.dump();
  chain_ = previous != nullptr ? previous->chain : sha256(header_);
  // Batches between that line and a state that lies behind it.
  std::vector<std::uint32_t> batch(trainer.last_windows().size());
  for (std::int64_t step = previous != nullptr ? previous->step : 0; step < trainer.step(); ++step) {
    trainer.windows_of_step(step, batch);
    batches_.add(std::as_bytes(std::span(batch)));
  }
}

std::optional<LedgerLine> LedgerWriter::after_step() {
  batches_.add(std::as_bytes(trainer_.last_windows()));
  if (trainer_.step() % every_ != 0 && !trainer_.done()) return std::nullopt;
  LedgerLine line{
      .step = trainer_.step(), .batches = batches_.hex(), .tensors = hashes_of(trainer_), .chain = {}};
  line.chain = chain_ = sha256(chain_ + line.text(false));
  batches_ = {};
  return line;
}

std::optional<LedgerDifference> difference(const Ledger& header, const LedgerLine& a, const LedgerLine& b) {
  if (a.tensors.size() != header.names.size() || b.tensors.size() != header.names.size())
    throw std::runtime_error("a ledger's line has other tensors than its header names");
  LedgerDifference d{.after = (a.step - 1) / header.every * header.every,
                     .step = a.step,
                     .what = {},
                     .batches = a.batches != b.batches};
  for (std::size_t i = 0; i < a.tensors.size() && d.what.empty(); ++i)
    if (a.tensors[i] != b.tensors[i]) d.what = header.names[i];
  if (d.what.empty() && !d.batches) return std::nullopt;
  if (d.what.empty()) d.what = "the batches";
  return d;
}

LedgerFile::LedgerFile(const std::string& run_folder, std::int64_t every, const Trainer& trainer,
                       std::map<std::string, std::string> origin)
    : folder_(run_folder),
      every_(every),
      trainer_(trainer),
      origin_(std::move(origin)),
      writer_(continued(run_folder)) {
  std::filesystem::create_directories(folder_ + "/states");
  if (trainer_.step() > 0) return;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ + "/states"))
    std::filesystem::remove(entry.path());  // of an earlier run that --force overwrites
  write_file(path_in(folder_), writer_.header() + "\n");
  keep_state();
}

LedgerWriter LedgerFile::continued(const std::string& run_folder) const {
  if (trainer_.step() == 0) return {trainer_, every_};
  Ledger ledger = Ledger::read(path_in(run_folder));
  if (ledger.every != every_)
    throw std::runtime_error("--ledger " + std::to_string(every_) +
                             ": the run that is resumed has one of every " + std::to_string(ledger.every) +
                             " steps; give the same");
  while (!ledger.lines.empty() && ledger.lines.back().step > trainer_.step()) ledger.lines.pop_back();
  const LedgerLine last = ledger.lines.empty() ? LedgerLine() : LedgerLine::of(ledger.lines.back().text);
  LedgerWriter writer(trainer_, every_, ledger.lines.empty() ? nullptr : &last);
  std::string text = writer.header() + "\n";
  for (const Ledger::Line& line : ledger.lines) text += line.text + "\n";
  write_file(path_in(run_folder), text);
  return writer;
}

std::int64_t LedgerFile::apart(std::int64_t every, std::int64_t total_steps) {
  constexpr std::int64_t kSegments = 20;
  const std::int64_t lines = (total_steps + every - 1) / every;
  return every * std::max<std::int64_t>(1, (lines + kSegments / 2) / kSegments);
}

std::string LedgerFile::state_path(const std::string& run_folder, std::int64_t step) {
  return run_folder + "/states/" + std::to_string(step) + ".safetensors";
}

void LedgerFile::after_step() {
  const std::optional<LedgerLine> line = writer_.after_step();
  if (!line) return;
  std::ofstream out(path_in(folder_), std::ios::app);
  out << line->text() << "\n" << std::flush;
  if (!out) throw FileError(path_in(folder_), "cannot be written; is the disk full?");
  if (line->step % apart(every_, trainer_.total_steps()) == 0 || trainer_.done()) keep_state();
}

void LedgerFile::keep_state() const { trainer_.save(state_path(folder_, trainer_.step()), origin_); }

}  // namespace supertac
