// What the pages of results have in common: their look, their parts, and that they need nothing from
// elsewhere.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/images/images.h"

namespace supertac {

/// Text that a page shows as it is: <, & and " are no markup.
std::string escaped(std::string_view text);

/// A card with a heading, a quiet line below it (none when empty) and `content`, which is HTML.
std::string page_section(const std::string& title, const std::string& note, const std::string& content);

/// `rows` is HTML: <tr>...</tr> for each.
std::string page_table(const std::vector<std::string>& heads, const std::string& rows);

/// A table of names and texts.
std::string page_facts(const std::vector<std::pair<std::string, std::string>>& facts);

/// A picture as the address of an <img>, itself in it.
std::string picture_address(const Picture& picture);

/// The whole page: `content` is HTML.
std::string result_page(const std::string& title, const std::string& content);

}  // namespace supertac
