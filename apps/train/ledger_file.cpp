#include "apps/train/ledger_file.h"

#include <filesystem>
#include <fstream>

#include "io/files/file.h"

namespace supertac {
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
