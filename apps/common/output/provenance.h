// What the files of a program say of how they were made. Safetensors files say what decides their content
// (io/files/safetensors.h), so that the same command still gives the same bytes; results, reports and folders
// also say when it was done and how long it took.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// In a folder that a program fills: a line for each time that it was filled.
inline constexpr char kFolderProvenance[] = "provenance.jsonl";

/// "0.2.0"
std::string version();
/// The commit the program was built from, "-dirty" when the tree had changes; "unknown" without git. Defined
/// in a file that the build writes.
const char* commit();

/// For main(): from now on files say command, version, commit and seed.
void begin_provenance(const Arguments& arguments);
/// An input of what is written from now on, by its content: "recordings", "model", "journal", ... An input of
/// the same name is replaced.
void add_parent(const std::string& name, const std::string& hash);
/// The same of a file: SHA-256 of its content (content_hash()), or of its bytes where it is no safetensors
/// file. Throws FileError.
void add_parent_file(const std::string& name, const std::string& path);
/// Of one model as "model", of several as "model 1" and so on.
void add_model_parents(const std::vector<std::string>& paths);
std::string hash_of_file(const std::string& path);

/// The whole of it, with the command line as given, when the program began (UTC) and how many seconds ago.
nlohmann::ordered_json full_provenance();

}  // namespace supertac
