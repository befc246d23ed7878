// supertac-check-gradients: what `supertac-check gradients` runs, compiled with real = double.
#include <algorithm>
#include <chrono>
#include <string>

#include "apps/check/gradient_cases.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "autograd/record.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

using Json = nlohmann::ordered_json;

void declare(Arguments&) {}

static void print_row(const Arguments& a, const std::string& kind, const std::string& name,
                      const std::string& entries, const std::string& error, const std::string& rest) {
  a.print(left_aligned(kind, 7) + left_aligned(name, 26) + left_aligned(entries, 9) +
          left_aligned(error, 10) + rest);
}

int run(Arguments& a) {
  const std::vector<GradientCase> cases = gradient_cases();
  const auto begin = std::chrono::steady_clock::now();
  print_row(a, "kind", "name", "entries", "error", "       worst entry");
  Json rows = Json::array();
  std::size_t wrong = 0;
  Dim all = 0;
  const auto progress = progress_of(a, "checking", "cases");
  for (auto c = cases.begin(); c != cases.end();) {  // a row for the cases of one name
    Json row = {{"kind", c->kind}, {"name", c->name}};
    Dim entries = 0;
    GradientEntry worst{};
    std::vector<std::string> reports;  // of cases with wrong entries, ten entries each
    for (const std::string& name = row["name"].get_ref<std::string&>(); c != cases.end() && c->name == name;
         ++c) {
      progress(static_cast<std::size_t>(c - cases.begin()), cases.size());
      const GradientReport report = c->check();
      if (entries == 0 || report.max_relative_error > worst.relative_error) worst = report.worst.front();
      if (report.wrong > 0) reports.push_back(report.text());
      entries += report.entries;
    }
    const bool is_wrong = !(worst.relative_error <= kGradientTolerance);
    print_row(a, row["kind"], row["name"], std::to_string(entries), digits(worst.relative_error, 3),
              (is_wrong ? "WRONG  " : "ok     ") + worst.place + ": analytic " + digits(worst.analytic, 10) +
                  ", numeric " + digits(worst.numeric, 10));
    for (const std::string& report : reports) a.print(report);
    row.update({{"entries", entries},
                {"wrong", is_wrong},
                {"worst",
                 {{"entry", worst.place},
                  {"analytic", worst.analytic},
                  {"numeric", worst.numeric},
                  {"relative_error", worst.relative_error}}}});
    rows.push_back(std::move(row));
    wrong += is_wrong;
    all += entries;
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  a.print(std::to_string(all) + " entries in " + format(seconds, 1) + " s, " + std::to_string(wrong) +
          " of " + std::to_string(rows.size()) + " rows wrong (relative error above " +
          format(kGradientTolerance) + ")");
  a.write_json({{"rows", rows}, {"entries", all}, {"wrong", wrong}, {"seconds", seconds}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

}  // namespace supertac
