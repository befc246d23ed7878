// What a port sends, as bytes, to be probed (data/frames/probe.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "data/frames/probe.h"
#include "hardware/ports/open_port.h"

namespace supertac {

/// What comes from the opened `port` within `seconds`, in which the machine does not stand still, at most
/// 16 MiB, or until `stop` says so. A datagram of text is a line. Throws PortError, but for the end of a
/// port: what came until then is what there is.
std::vector<Heard> listen(const OpenedPort& opened, const std::string& port, double seconds,
                          const std::function<bool()>& stop);

}  // namespace supertac
