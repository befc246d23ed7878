#include "apps/common/running/ports.h"

#include "data/sensors/rig.h"
#include "hardware/ports/port_list.h"

namespace supertac {

void print_ports(const Arguments& arguments) {
  const std::vector<PortInfo> ports = list_ports();
  for (const PortInfo& port : ports) {
    const std::string board = port.usb_id == rig::kBoardUsbId ? "  <- tactile board" : "";
    arguments.print(port.path + "  " + port.usb_id + "  " + port.product + board);
  }
  if (ports.empty()) arguments.print("no USB serial ports found");
}

}  // namespace supertac
