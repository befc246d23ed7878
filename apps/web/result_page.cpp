#include "apps/web/result_page.h"

#include <stdexcept>

#include "apps/web/pages.h"

namespace supertac {

std::string result_page(const nlohmann::ordered_json& data) {
  using Json = nlohmann::ordered_json;
  std::string text = data.dump(-1, ' ', true, Json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  constexpr std::string_view kMark = "<!--data-->";
  std::string page(report_page_frame());
  return page.replace(page.find(kMark), kMark.size(), text);
}

}  // namespace supertac
