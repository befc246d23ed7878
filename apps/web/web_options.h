#pragma once

#include <optional>

#include "apps/common/command_line/arguments.h"
#include "apps/web/web_server.h"

namespace supertac {

/// Declares --web.
void declare_web(Arguments& a);
/// Where the page is served; nothing without --web. Warns when the network may see it. Throws UsageError.
std::optional<WebAddress> web_address(const Arguments& a);

}  // namespace supertac
