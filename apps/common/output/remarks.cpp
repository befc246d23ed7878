#include "apps/common/output/remarks.h"

#include <stdexcept>

#include "io/numbers/text.h"

namespace supertac {

void declare_strict(Arguments& a) { a.flag("strict", "what would be a warning about the data is an error"); }

void remark(const Arguments& a, const std::vector<std::string>& remarks) {
  if (!remarks.empty() && a.flag("strict")) throw std::runtime_error(joined(remarks, "; ") + " (--strict)");
  for (const std::string& one : remarks) a.note("warning: " + one);
}

}  // namespace supertac
