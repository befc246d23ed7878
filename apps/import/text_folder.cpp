#include "apps/import/text_folder.h"

#include <omp.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "data/plates/plate.h"
#include "data/registration/pass_features.h"
#include "data/registration/registration.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

/// Entries of a folder by name, hidden ones left out.
std::vector<fs::path> entries_of(const fs::path& folder, bool folders) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const bool hidden = entry->path().filename().string().starts_with(".");
    if (!hidden && entry->is_directory() == folders) entries.push_back(entry->path());
  }
  if (error)
    throw FileError(folder.string(), "cannot list the folder: " + error.message() + "; check the name");
  std::sort(entries.begin(), entries.end());
  return entries;
}

int index_named(const fs::path& path, const std::string& name) {
  const auto number = parse_int(name);
  if (number && *number >= 1 && *number <= 1'000'000) return static_cast<int>(*number);
  throw FileError(path.string(), "expected a number from 1 as its name: TEXT_DIR/<plate>/<trial>/<pass>.txt");
}

ImportedPass found_pass(const fs::path& folder, const std::string& plate_file) {
  const std::string name = folder.filename().string();
  const bool unknown = plate_file.empty() && is_unknown_plate(name);
  try {
    ImportedPass found{.path = {},
                       .plate = Plate::named(unknown              ? "plain"
                                             : plate_file.empty() ? name
                                                                  : plate_file),
                       .unknown = unknown,
                       .plate_file = plate_file};
    found.recording.plate = unknown ? name : found.plate.name();
    return found;
  } catch (const std::invalid_argument& error) {
    throw FileError(folder.string(), std::string("unknown plate: ") + error.what() +
                                         "; or name the folder unknown_... to import it without truth");
  }
}

/// Does it, or leaves it out with its FileError.
void take_or_leave(const FolderImport& settings, const auto& act) {
  try {
    act();
  } catch (const FileError& error) {
    if (!settings.left_out) throw;
    settings.left_out(error);
  }
}

void find_passes_of(const fs::path& folder, const FolderImport& settings, std::vector<ImportedPass>& passes) {
  const std::string stl = folder.string() + ".stl";
  ImportedPass found = found_pass(folder, fs::exists(stl) ? stl : "");
  std::map<std::pair<int, int>, std::string> named;  // trial and pass
  const auto take_pass = [&](const fs::path& pass) {
    found.path = pass.string();
    found.recording.pass = index_named(pass, pass.stem().string());
    const auto [first, is_new] =
        named.emplace(std::pair(found.recording.trial, found.recording.pass), found.path);
    if (!is_new)
      throw FileError(found.path, "is the same trial and pass as " + first->second + "; rename one of them");
    passes.push_back(found);
  };
  const auto take_trial = [&](const fs::path& trial) {
    found.recording.trial = index_named(trial, trial.filename().string());
    for (const fs::path& pass : entries_of(trial, false))
      if (pass.extension() == ".txt") take_or_leave(settings, [&] { take_pass(pass); });
  };
  for (const fs::path& trial : entries_of(folder, true)) take_or_leave(settings, [&] { take_trial(trial); });
}

std::vector<ImportedPass> find_passes(const std::string& root, const FolderImport& settings) {
  std::vector<ImportedPass> passes;
  for (const fs::path& folder : entries_of(root, true))
    take_or_leave(settings, [&] { find_passes_of(folder, settings, passes); });
  if (passes.empty())
    throw FileError(root, "holds no <plate>/<trial>/<pass>.txt; name the folder above the plates");
  return passes;
}

void read_and_register(ImportedPass& pass, double speed_mm_s) {
  Recording recording = import_text_pass(pass.path, pass.lines);
  recording.plate = pass.recording.plate;
  recording.trial = pass.recording.trial;
  recording.pass = pass.recording.pass;
  recording.speed_mm_s = speed_mm_s;
  restore_clock(recording, rig::kFrameRateHz);
  if (!pass.unknown) pass.registration = register_pass(recording, pass.plate);
  pass.recording = std::move(recording);
}

/// On all threads; returns the error of each pass, or none.
std::vector<std::exception_ptr> read_and_register(std::span<ImportedPass> passes, double speed_mm_s) {
  std::vector<std::exception_ptr> errors(passes.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < passes.size(); ++i) {
    try {
      read_and_register(passes[i], speed_mm_s);
    } catch (...) {  // an exception must not leave a thread
      errors[i] = std::current_exception();
    }
  }
  return errors;
}

void align(std::vector<ImportedPass>& plate) {
  std::vector<RegisteredPass> passes;
  for (ImportedPass& pass : plate) passes.push_back({&pass.recording, &pass.registration});
  align_passes(passes);
  for (ImportedPass& pass : plate)  // it may have changed rates and found losses
    if (pass.registration.reliable) judge(pass.registration, pass.recording, pass.plate);
}

}  // namespace

void import_text_folder(const std::string& root, const FolderImport& settings,
                        const std::function<void(std::vector<ImportedPass>)>& take) {
  std::vector<ImportedPass> found = find_passes(root, settings);
  const auto progress = [&](std::size_t done) {
    if (settings.progress) settings.progress(done, found.size());
  };
  const auto at_a_time = static_cast<std::size_t>(omp_get_max_threads());
  bool any = false;
  std::vector<ImportedPass> plate;
  for (std::size_t i = 0; i < found.size();) {
    progress(i);
    const std::string name = found[i].recording.plate;
    std::size_t end = i;
    while (end < found.size() && end < i + at_a_time && found[end].recording.plate == name) ++end;
    const std::vector<std::exception_ptr> errors =
        read_and_register(std::span(found).subspan(i, end - i), settings.speed_mm_s);
    for (const std::exception_ptr& error : errors)
      take_or_leave(settings, [&] {
        ImportedPass& pass = found[i++];
        if (error) std::rethrow_exception(error);
        plate.push_back(std::move(pass));
      });
    const bool last = end == found.size() || found[end].recording.plate != name;
    if (!last || plate.empty()) continue;
    any = true;
    progress(end);
    if (plate.front().plate.uniform_in_x() && !plate.front().unknown) align(plate);
    for (ImportedPass& pass : plate)
      if (!pass.unknown) apply(pass.registration, pass.recording, rig::pass_x_mm(pass.recording.pass));
    take(std::exchange(plate, {}));
  }
  if (!any) throw FileError(root, "none of " + std::to_string(found.size()) + " files is a recording");
}

std::string ImportedPass::summary() const {
  std::string line = (unknown ? recording.plate : plate.name()) + "/" + std::to_string(recording.trial) +
                     "/" + std::to_string(recording.pass) + ".txt  " + std::to_string(lines.lines) +
                     " lines, " + std::to_string(lines.dropped()) + " dropped, ";
  if (unknown) return line + "of unknown shape: no position, no truth";
  line += "residual " + format(registration.residual, 2) + " mm, ";
  if (registration.agreement > 0) line += "aligned by " + format(registration.shift_mm, 2) + " mm, ";
  if (registration.lost_s > 0) line += "another " + format(registration.lost_s, 2) + " s lost, ";
  return line + (registration.reliable ? "reliable" : "not reliable: " + registration.reason);
}

nlohmann::ordered_json ImportedPass::to_json() const {
  return {{"file", path},
          {"plate", recording.plate},
          {"trial", recording.trial},
          {"pass", recording.pass},
          {"lines", lines.lines},
          {"frames", lines.frames},
          {"dropped", lines.dropped()},
          {"registration",
           {{"start_mm", registration.start_mm},
            {"rate_mm_s", registration.rate},
            {"residual_mm", registration.residual},
            {"contacts", registration.contacts},
            {"elements", registration.elements},
            {"matched", registration.matched},
            {"coverage", registration.coverage},
            {"margin", registration.margin},
            {"shift_mm", registration.shift_mm},
            {"stretch_mm", registration.stretch_mm},
            {"lost_at_s", registration.lost_at_s},
            {"lost_s", registration.lost_s},
            {"agreement", registration.agreement},
            {"reliable", registration.reliable},
            {"reason", registration.reason}}}};
}

}  // namespace supertac
