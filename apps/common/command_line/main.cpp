// main() of every program.
#include "apps/common/command_line/program.h"

namespace supertac {

void declare(Arguments& arguments);
int run(Arguments& arguments);
// In a source that apps/CMakeLists.txt writes for each program.
extern const char *program_name, *program_purpose;
extern std::pair<std::string_view, bool> (*program_kernels)();

}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  return run_program({program_name, program_purpose, declare, run, program_kernels}, argc, argv);
}
