#include "apps/web/web_options.h"

namespace supertac {

void declare_web(Arguments& a) {
  a.option_alone("web", "PORT", "show a live page in a browser on this computer (default port 8080)", "8080")
      .only_with("web")
      .option("web-bind", "ADDRESS", "let the network see the page and its buttons: 0.0.0.0, or one address");
}

std::optional<WebAddress> web_address(const Arguments& a) {
  if (!a.given("web")) return std::nullopt;
  WebAddress address{.port = static_cast<std::uint16_t>(a.integer("web", 0, 65535))};
  if (a.given("web-bind")) address.bind = a.text("web-bind");
  if (!address.is_loopback())
    a.note("warning: --web-bind " + address.bind +
           ": everybody who reaches this computer may watch, and press the page's buttons");
  return address;
}

}  // namespace supertac
