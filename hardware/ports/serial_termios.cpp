#include "hardware/ports/serial_port.h"

#include <asm/termbits.h>
#include <errno.h>
#include <sys/ioctl.h>

namespace supertac {

int set_raw_terminal(int descriptor, unsigned baud) {
  termios2 settings{};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return errno;
  settings.c_iflag = 0;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  settings.c_ispeed = baud;
  settings.c_ospeed = baud;
  settings.c_cc[VMIN] = 1;  // so that an empty port is EAGAIN and read 0 only ever means end of file
  settings.c_cc[VTIME] = 0;
  return ioctl(descriptor, TCSETS2, &settings) == 0 ? 0 : errno;
}

unsigned terminal_baud(int descriptor) {
  termios2 settings{};
  return ioctl(descriptor, TCGETS2, &settings) == 0 ? settings.c_ospeed : 0;
}

}  // namespace supertac
