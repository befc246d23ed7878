// The pages, each one piece of HTML that needs nothing from elsewhere; written from page.html and its like at
// build time.
#pragma once

#include <string_view>

namespace supertac {

std::string_view live_page();
std::string_view collect_page();
/// With <!--content--> where the results stand and <!--films--> where their films (JSON).
std::string_view evaluation_page();

}  // namespace supertac
