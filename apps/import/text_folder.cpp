#include "apps/import/text_folder.h"

#include <omp.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "data/plates/plate.h"
#include "data/registration/registration.h"
#include "io/numbers/numbers.h"
#include "io/numbers/parallel.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

int index_named(const fs::path& path, const std::string& name) {
  const auto number = parse_int(name);
  if (number && *number >= 1 && *number <= 1'000'000) return static_cast<int>(*number);
  throw FileError(path.string(), "expected a number from 1 as its name: TEXT_DIR/<plate>/<trial>/<pass>.txt");
}

ImportedPass found_pass(const fs::path& folder) {
  const std::string stl = folder.string() + ".stl", plate_file = fs::exists(stl) ? stl : "";
  try {
    ImportedPass found{.path = {},
                       .plate = Plate::named(plate_file.empty() ? folder.filename().string() : plate_file),
                       .plate_file = plate_file};
    found.recording.plate = found.plate.name();
    return found;
  } catch (const std::invalid_argument& error) {
    throw FileError(folder.string(), std::string("unknown plate: ") + error.what() +
                                         "; text over another surface is a table of any sensor's (--sensor)");
  }
}

/// Does it with each entry of a folder, or leaves that out with its FileError.
void for_each_entry(const fs::path& folder, bool folders, const FolderImport& settings, const auto& act) {
  for (const fs::path& entry : entries_of(folder, folders)) {
    try {
      act(entry);
    } catch (const FileError& error) {
      settings.left_out(error);
    }
  }
}

std::vector<ImportedPass> find_passes(const std::string& root, const FolderImport& settings) {
  std::vector<ImportedPass> passes;
  for_each_entry(root, true, settings, [&](const fs::path& folder) {
    ImportedPass found = found_pass(folder);
    Recording& r = found.recording;
    for_each_entry(folder, true, settings, [&](const fs::path& trial) {
      r.trial = index_named(trial, trial.filename().string());
      for_each_entry(trial, false, settings, [&](const fs::path& pass) {
        if (pass.extension() != ".txt") return;
        found.path = pass.string();
        r.pass = index_named(pass, pass.stem().string());
        for (const ImportedPass& other : passes)
          if (std::tie(other.recording.plate, other.recording.trial, other.recording.pass) ==
              std::tie(r.plate, r.trial, r.pass))
            throw FileError(found.path,
                            "is the same trial and pass as " + other.path + "; rename one of them");
        passes.push_back(found);
      });
    });
  });
  if (passes.empty())
    throw FileError(root, "holds no <plate>/<trial>/<pass>.txt; name the folder above the plates");
  return passes;
}

void read_and_register(ImportedPass& pass, double speed_mm_s) {
  Recording recording = import_text_pass(pass.path, pass.dropped);
  pass.lines = recording.frames() + pass.dropped;
  recording.plate = pass.recording.plate;
  recording.trial = pass.recording.trial;
  recording.pass = pass.recording.pass;
  recording.speed_mm_s = speed_mm_s;
  restore_clock(recording, rig::kFrameRateHz);
  pass.registration = register_pass(recording, pass.plate);
  pass.recording = std::move(recording);
}

/// On all threads; those that are no recordings are left out.
std::vector<ImportedPass> read_and_register(std::span<ImportedPass> found, const FolderImport& settings) {
  std::vector<std::optional<FileError>> errors(found.size());
  parallel_for(found.size(), [&](std::size_t i) {
    try {
      read_and_register(found[i], settings.speed_mm_s);
    } catch (const FileError& error) {
      errors[i] = error;
    }
  });
  std::vector<ImportedPass> passes;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (errors[i])
      settings.left_out(*errors[i]);
    else
      passes.push_back(std::move(found[i]));
  }
  return passes;
}

void align(std::vector<ImportedPass>& plate) {
  std::vector<RegisteredPass> passes;
  for (ImportedPass& pass : plate) passes.push_back({&pass.recording, &pass.registration});
  align_passes(passes);
  for (ImportedPass& pass : plate)  // it may have changed rates and found losses
    if (pass.registration.reliable) judge(pass.registration, pass.recording, pass.plate);
}

}  // namespace

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

void import_text_folder(const std::string& root, const FolderImport& settings,
                        const std::function<void(std::vector<ImportedPass>)>& take) {
  std::vector<ImportedPass> found = find_passes(root, settings);
  bool any = false;
  for (auto begin = found.begin(), end = begin; begin != found.end(); begin = end) {
    end = std::find_if(begin, found.end(), [&](const ImportedPass& pass) {
      return pass.recording.plate != begin->recording.plate;
    });
    std::vector<ImportedPass> plate;
    for (auto from = begin, to = from; from != end; from = to) {  // between them Ctrl-C is heard
      to = from + std::min<std::ptrdiff_t>(omp_get_max_threads(), end - from);
      settings.progress(static_cast<std::size_t>(from - found.begin()), found.size());
      std::ranges::move(read_and_register(std::span(from, to), settings), std::back_inserter(plate));
    }
    if (plate.empty()) continue;
    any = true;
    settings.progress(static_cast<std::size_t>(end - found.begin()), found.size());
    if (plate.front().plate.uniform_in_x()) align(plate);
    for (ImportedPass& pass : plate)
      apply(pass.registration, pass.recording, rig::pass_x_mm(pass.recording.pass));
    take(std::move(plate));
  }
  if (!any) throw FileError(root, "none of " + std::to_string(found.size()) + " files is a recording");
}

std::string ImportedPass::summary() const {
  std::string line = plate.name() + "/" + std::to_string(recording.trial) + "/" +
                     std::to_string(recording.pass) + ".txt  " + std::to_string(lines) + " lines, " +
                     std::to_string(dropped) + " dropped, ";
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
          {"lines", lines},
          {"frames", lines - dropped},
          {"dropped", dropped},
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
