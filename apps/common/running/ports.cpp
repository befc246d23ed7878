#include "apps/common/running/ports.h"

#include "data/sensors/rig.h"
#include "hardware/ports/port_list.h"

namespace supertac {

void print_ports(const Arguments& arguments) {
  const std::vector<PortInfo> ports = list_ports();
  for (const PortInfo& port : ports) {
    const std::string board = port.usb_id == rig::kBoardUsbId ? "  <- tactile board" : "";
    const std::string lasting = lasting_port_name(port.path);
    arguments.print(port.path + "  " + port.usb_id + "  " + port.product + board +
                    (lasting == port.path ? "" : "  also under another number: " + lasting));
  }
  if (ports.empty()) arguments.print("no USB serial ports found");
}

}  // namespace supertac
