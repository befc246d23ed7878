#include "hardware/palpation_program.h"

#include <stdexcept>

#include "hardware/printer.h"

namespace supertac {

std::string palpation_program(const PalpationPlan& plan, const Point3& origin, const Limits& limits,
                              const std::string& title) {
  if (title.find_first_of("\r\n") != std::string::npos)
    throw std::invalid_argument("palpation_program: the title has a line break, which would end its comment");
  const std::vector<Leg> legs = legs_of(plan, origin);
  for (const Leg& leg : legs) limits.check_path(leg.from, leg.to);
  std::string text = "; " + title + "\n; Lengths in mm, F in mm/min. The finger is lifted before every way " +
                     "to another pass.\nG21\nG90\nM0 Head at " + describe(origin) +
                     " and the plate below it?\n" + origin_command(origin) + "\n";
  for (const Leg& leg : legs) {
    text += "; pass " + std::to_string(leg.pass) + ": " + name_of(leg.phase) + "\n" +
            move_command(leg.to, leg.speed) + "\nM400\n";
  }
  return text;
}

}  // namespace supertac
