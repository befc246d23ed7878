#pragma once

#include <optional>

#include "apps/common/command_line/arguments.h"
#include "apps/web/web_server.h"

namespace supertac {

/// Declares --web and --web-bind; the last ones, since --web-bind stands beside --web only.
void declare_web(Arguments& a);
/// Where the page is served; nothing without --web. Warns when the network may see it.
std::optional<WebAddress> web_address(const Arguments& a);

}  // namespace supertac
