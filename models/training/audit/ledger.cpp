#include "models/training/audit/ledger.h"

#include <algorithm>
#include <charconv>
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
constexpr std::size_t kHashDigits = 64;

// A line in its parts, without looking at its tensors: of a long training there are gigabytes. Nothing when
// it is none.
std::optional<Ledger::Line> line_in(const std::string& text) {
  const std::size_t cut = text.rfind(kChain);
  Ledger::Line line{0, {}, text};
  if (!text.starts_with(kStep) || cut == std::string::npos ||
      text.size() != cut + kChain.size() + kHashDigits + 2 ||
      std::from_chars(text.data() + kStep.size(), text.data() + cut, line.step).ec != std::errc())
    return std::nullopt;
  line.chain = text.substr(cut + kChain.size(), kHashDigits);
  return line;
}

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
    std::optional<Line> line = line_in(text);
    if (!line) throw FileError(path, none);
    chain = sha256(chain + text.substr(0, text.rfind(kChain)) + "}");
    if (line->chain != chain)
      throw FileError(path, "step " + std::to_string(line->step) +
                                ": the chain is broken; a line was changed after it had been written");
    ledger.lines.push_back(std::move(*line));
  }
  return ledger;
}

std::optional<LedgerLine> Ledger::at(std::int64_t step) const {
  const auto found = std::lower_bound(lines.begin(), lines.end(), step,
                                      [](const Line& line, std::int64_t s) { return line.step < s; });
  if (found == lines.end() || found->step != step) return std::nullopt;
  return LedgerLine::of(found->text);
}

std::vector<std::string> hashes_of(const Trainer& trainer) {
  std::vector<std::string> hashes;
  trainer.for_each_tensor([&](const std::string&, const Tensor& values) {
    Sha256 hash;
    hash.add(std::as_bytes(values.values()));
    hashes.push_back(hash.hex());
  });
  return hashes;
}

LedgerWriter::LedgerWriter(const Trainer& trainer, std::int64_t every, const LedgerLine* previous)
    : trainer_(trainer), every_(every) {
  std::vector<std::string> names;
  trainer.for_each_tensor([&](const std::string& name, const Tensor&) { names.push_back(name); });
  header_ = Json{{"format", kFormat}, {"every", every}, {"tensors", names}}.dump();
  chain_ = previous != nullptr ? previous->chain : sha256(header_);
  // Batches between that line and a state that lies behind it.
  std::vector<std::uint32_t> batch(trainer.batch().size());
  for (std::int64_t step = previous != nullptr ? previous->step : 0; step < trainer.step(); ++step) {
    trainer.batch_of(step, batch);
    batches_.add(std::as_bytes(std::span(batch)));
  }
}

std::optional<LedgerLine> LedgerWriter::after_step() {
  batches_.add(std::as_bytes(trainer_.batch()));
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

}  // namespace supertac
