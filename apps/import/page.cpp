#include "apps/import/page.h"

#include "apps/common/command_line/program.h"
#include "apps/web/result_page.h"
#include "data/registration/registration_picture.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

std::string name_of(const Recording& recording) {
  return recording.plate + ", trial " + std::to_string(recording.trial) + ", pass " +
         std::to_string(recording.pass);
}

// The plate's y under a picture of it.
std::string axis() {
  std::string svg = "<svg viewBox=\"0 0 680 30\" style=\"max-width:none\" aria-hidden=\"true\">";
  for (int mm = 20; mm <= 88; mm += 4) {
    const std::string x = format(10.0 * (mm - kPictureFromMm) * 68 / (kPictureToMm - kPictureFromMm), 1);
    svg += "<path d=\"M" + x + " 0v4\" stroke=\"var(--quiet)\"/><text x=\"" + x +
           "\" y=\"15\" text-anchor=\"" +
           (mm == 20   ? "start"
            : mm == 88 ? "end"
                       : "middle") +
           "\">" + std::to_string(mm) + "</text>";
  }
  return svg + "<text x=\"340\" y=\"28\" text-anchor=\"middle\">y on the plate, mm</text></svg>";
}

}  // namespace

void ImportPage::add(const ImportedPass& pass) {
  const Registration& r = pass.registration;
  const auto cell = [](const std::string& text) { return "<td>" + escaped(text) + "</td>"; };
  const bool placed = !pass.unknown;
  rows_ += "<tr>" + cell(name_of(pass.recording)) + cell(std::to_string(pass.lines.frames)) +
           cell(std::to_string(pass.lines.lines - pass.lines.empty - pass.lines.frames)) +
           cell(placed ? format(r.residual, 2) : "-") + cell(placed ? format(r.shift_mm, 2) : "-") +
           cell(placed ? format(r.lost_s, 2) : "-") +
           cell(pass.unknown ? "of unknown shape"
                : r.reliable ? "reliable"
                             : "not reliable: " + r.reason) +
           "</tr>";
  if (!placed) return;
  const std::string name = name_of(pass.recording);
  pictures_ += "<figure><p>" + escaped(name) + (r.reliable ? "" : ": not reliable, " + escaped(r.reason)) +
               "</p><img style=\"width:100%\" alt=\"signals of " + escaped(name) + "\" src=\"" +
               picture_address(registration_picture(pass.recording, pass.plate)) + "\">" + axis() +
               "</figure>";
}

std::string ImportPage::html(const std::string& command) const {
  return result_page(
      "SuperTac import",
      page_section(
          "Passes",
          "residual of a contact against the plate, mm; aligned with other passes by, mm; further loss, s",
          page_table({"pass", "frames", "lines dropped", "residual", "aligned", "lost", "verdict"}, rows_)) +
          page_section(
              "Signals under the plate",
              "top band: the plate; below it the 16 taxels, the leading row first, each where its row "
              "feels contact. In a pass that fits, bright patches stand under the plate's elements.",
              pictures_) +
          page_section("What made this page", "", page_facts({{"command", command}, {"commit", commit()}})));
}

}  // namespace supertac
