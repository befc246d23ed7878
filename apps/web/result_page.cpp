#include "apps/web/result_page.h"

#include "apps/web/encode.h"
#include "apps/web/pages.h"

namespace supertac {
namespace {

void replace(std::string& page, std::string_view mark, const std::string& text) {
  for (std::size_t at = 0; (at = page.find(mark, at)) != std::string::npos; at += text.size())
    page.replace(at, mark.size(), text);
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text)
    out += c == '<' ? "&lt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

std::string page_section(const std::string& title, const std::string& note, const std::string& content) {
  return "<section class=\"card\"><h2>" + escaped(title) + "</h2>" +
         (note.empty() ? "" : "<p class=\"quiet\">" + escaped(note) + "</p>") + content + "</section>\n";
}

std::string page_table(const std::vector<std::string>& heads, const std::string& rows) {
  std::string text = "<div class=\"scroll\"><table><thead><tr>";
  for (const std::string& head : heads) text += "<th scope=\"col\">" + escaped(head) + "</th>";
  return text + "</tr></thead><tbody>" + rows + "</tbody></table></div>";
}

std::string page_facts(const std::vector<std::pair<std::string, std::string>>& facts) {
  std::string rows;
  for (const auto& [name, text] : facts)
    rows += "<tr><td>" + escaped(name) + "</td><td style=\"text-align:left;white-space:pre-wrap\"><code>" +
            escaped(text) + "</code></td></tr>";
  return page_table({"", ""}, rows);
}

std::string picture_address(const Picture& picture) {
  const std::vector<std::byte> file = encode_png(picture);
  return "data:image/png;base64," +
         base64(std::span(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()));
}

std::string result_page(const std::string& title, const std::string& content) {
  std::string page(report_page_frame());
  replace(page, "<!--title-->", escaped(title));
  replace(page, "<!--content-->", content);
  return page;
}

}  // namespace supertac
