// The pages, each one piece of HTML that needs nothing from elsewhere; put together from frame.html and
// its like at build time.
#pragma once

#include <string_view>

namespace supertac {

std::string_view live_page();
std::string_view collect_page();
/// GET /link.js of both: how they hear of their program.
std::string_view link_script();
/// Of results, with <!--data--> where their JSON stands: see result_page.h.
std::string_view report_page_frame();

}  // namespace supertac
