#include "tests/apps/hostile/evil_value.h"

#include <sstream>
#include <vector>

namespace supertac {

std::string evil_value(const RandomStream& random, std::uint64_t at) {
  static const std::vector<std::string> values = [] {
    std::vector<std::string> all = {
        "", "x\ny", "\x1b[31mred", "\xff\xfe", std::string(300, 'x'), std::string(5000, 'y')};
    std::istringstream words(
        "0 -1 1 2 nan inf 1e308 1e-308 18446744073709551616 0x10 1,,2 , plain ridges6 ridges0.0000001 "
        "ridgesinf "
        "bumps-1 precious precious.stl data data/1 data/good model new new/er loop fifo empty link /dev/null "
        "/dev/zero /dev/full /proc/self/mem / . .. - -- $(touch${IFS}PWNED) `touch${IFS}PWNED` "
        "a;touch${IFS}PWNED "
        "q';system('touch${IFS}PWNED');x=' 4x4 16x16 window paper %s%n%x precious,precious");
    for (std::string word; words >> word;) all.push_back(word);
    return all;
  }();
  return values[random.bits(at) % values.size()];
}

}  // namespace supertac
