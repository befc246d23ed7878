#include "apps/web/web_options.h"

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

void declare_web(Arguments& a) {
  a.option_alone("web", "[ADDRESS:]PORT",
                 "show a live page in a browser on this computer (default port 8080), or with an address "
                 "(0.0.0.0 for all) to the network, its buttons included",
                 "8080");
}

std::optional<WebAddress> web_address(const Arguments& a) {
  if (!a.given("web")) return std::nullopt;
  const std::string text = a.text("web");
  const std::size_t port_at = text.find(':') + 1;  // 0 where there is no address
  WebAddress address;
  if (port_at > 0) address.bind = text.substr(0, port_at - 1);
  const auto port = parse_uint(text.substr(port_at));
  if (!port || *port > 65535)
    throw UsageError("--web: expected PORT or ADDRESS:PORT with a port from 0 to 65535, found " +
                     in_quotes(text));
  address.port = static_cast<std::uint16_t>(*port);
  if (!address.is_loopback())
    a.note("warning: --web " + text +
           ": everybody who reaches this computer may watch, and press the page's buttons");
  return address;
}

}  // namespace supertac
