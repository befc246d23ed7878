// supertac-check: what an auditor asks of this machine and of a file.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "apps/common/program.h"
#include "io/file.h"

namespace supertac {

void declare(Arguments& a) {
  a.positional("WHAT", "gradients: every gradient against finite differences, in double precision");
  a.option("break", "OP",
           "gradients: plant errors in the reverse step of this op, or of 'all', one after the other: wrong "
           "sign, doubled, without a term, at the wrong index; each has to be found");
}

namespace {

// Double precision is a program of its own: one program cannot hold the same sources twice.
int check_gradients(const Arguments& a) {
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "supertac-check-gradients";
  std::vector<std::string> words{program};
  for (const char* name : {"break", "json"}) {
    if (a.given(name)) words.insert(words.end(), {std::string("--") + name, a.text(name)});
  }
  for (const char* name : {"force", "quiet"})
    if (a.given(name)) words.push_back(std::string("--") + name);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  ::execv(program.c_str(), pointers.data());
  throw FileError(program, std::string("cannot be run: ") + std::strerror(errno));
}

}  // namespace

int run(Arguments& a) {
  a.choice("WHAT", {"gradients"});
  return check_gradients(a);
}

}  // namespace supertac
