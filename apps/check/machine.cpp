#include "apps/check/check.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "apps/common/command_line/program.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "data/sensors/rig.h"
#include "hardware/ports/serial_port.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Finding {
  std::string what, found, advice;  // advice: "" = all is well
};

Finding processor() {
  const kernels::IsaKernels& set = kernels::isa_kernels();
  if (&set == &kernels::kPortableKernels)
    return {"processor", "no fused multiply-add",
            "results are the same, computing takes many times longer; use a processor from 2013 on"};
  return {"processor", "kernels " + std::string(set.name), ""};
}

Finding threads() {
  const int granted = default_threads();
  const auto online = ::sysconf(_SC_NPROCESSORS_ONLN);
  return {"threads", std::to_string(granted) + " of " + std::to_string(online) + " processors",
          granted < online
              ? "OMP_NUM_THREADS, the affinity mask or a quota grants fewer; --threads N asks for more"
              : ""};
}

Finding memory() {
  constexpr double kWanted = 512;
  std::ifstream info("/proc/meminfo");
  double available = 0;
  for (std::string key; info >> key;) {
    if (key == "MemAvailable:") info >> available;
  }
  return {
      "memory", format(available / 1024, 0) + " MB available",
      available / 1024 < kWanted ? "training wants " + format(kWanted, 0) + " MB; close other programs" : ""};
}

Finding disk() {
  constexpr double kWanted = 2;
  std::error_code error;
  const fs::space_info space = fs::space(".", error);
  const double gigabytes = error ? 0 : static_cast<double>(space.available) / 1e9;
  if (::access(".", W_OK) != 0)
    return {"disk", "this folder cannot be written to", "work in a folder of your own"};
  return {"disk", format(gigabytes, 1) + " GB free here",
          gigabytes < kWanted ? "recordings and runs want " + format(kWanted, 0) + " GB; free some" : ""};
}

// The group that opens serial ports: dialout in Debian and Fedora, uucp in Arch. Read from the file itself,
// since a static program has no other way.
Finding group() {
  std::map<std::string, std::uint64_t> numbers;
  std::ifstream groups("/etc/group");
  for (std::string name, word, number, members; std::getline(groups, name, ':');) {
    std::getline(groups, word, ':'), std::getline(groups, number, ':'), std::getline(groups, members);
    if (const auto gid = parse_uint(number)) numbers[name] = *gid;
  }
  const std::string rule =
      "sudo sh -c 'supertac check udev > /etc/udev/rules.d/60-supertac.rules', then plug the sensor in anew";
  const std::string name = numbers.contains("dialout") ? "dialout" : "uucp";
  if (!numbers.contains(name)) return {"serial ports' group", "none", ::geteuid() == 0 ? "" : rule};
  if (::geteuid() == 0 || ::group_member(static_cast<gid_t>(numbers[name])) != 0)
    return {"serial ports' group", name, ""};
  return {"serial ports' group", "not in " + name,
          "ports cannot be opened: sudo usermod -aG " + name + " $USER, then log in anew; or " + rule};
}

void ports(std::vector<Finding>& findings) {
  bool board = false;
  for (const PortInfo& port : list_ports()) {
    board = board || port.usb_id == rig::kBoardUsbId;
    const bool allowed = ::access(port.path.c_str(), R_OK | W_OK) == 0;
    const std::string lasting = lasting_port_name(port.path);
    findings.push_back({"port " + port.path,
                        (port.product.empty() ? port.usb_id : port.product) +
                            (lasting == port.path ? "" : ", also under another number " + lasting),
                        allowed ? "" : "no permission: see the serial ports' group"});
  }
  findings.push_back(
      {"the rig's board", board ? "found" : "not found",
       board ? "" : "plug it in for collecting and streaming; recordings and the virtual rig need none"});
}

// Services that open serial ports by themselves and talk to what is behind them.
void services(std::vector<Finding>& findings) {
  std::string running;
  std::error_code error;
  for (const auto& process : fs::directory_iterator("/proc", error)) {
    std::ifstream name(process.path() / "comm");
    std::string text;
    if (!std::getline(name, text)) continue;
    for (const char* grabs : {"ModemManager", "brltty", "octoprint", "klippy", "pronterface", "gpsd"})
      if (text == grabs) running += (running.empty() ? "" : ", ") + text;
  }
  findings.push_back(
      {"services that take serial ports", running.empty() ? "none running" : running,
       running.empty() ? "" : "they talk to board and printer; sudo systemctl stop " + running});
}

}  // namespace

int print_udev_rule(const Arguments& a) {
  a.print(
      R"(# Serial ports of USB devices: whoever sits at this machine may open them, and ModemManager lets them be.
SUBSYSTEM=="tty", SUBSYSTEMS=="usb", TAG+="uaccess", ENV{ID_MM_DEVICE_IGNORE}="1")");
  return kExitOk;
}

int check_machine(const Arguments& a) {
  std::vector<Finding> findings{processor(), threads(), memory(), disk(), group()};
  ports(findings);
  services(findings);
  Json rows = Json::array();
  for (const Finding& f : findings) {
    a.print((f.advice.empty() ? "ok    " : "look  ") + f.what + ": " + f.found +
            (f.advice.empty() ? "" : "; " + f.advice));
    rows.push_back({{"what", f.what}, {"found", f.found}, {"advice", f.advice}});
  }
  a.write_json({{"findings", rows}});
  return kExitOk;
}

}  // namespace supertac
