#include "hardware/ports/serial_port.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "hardware/ports/errors.h"
#include "hardware/virtual_rig/virtual_rig.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::serial_port_test {

/// A pseudo-terminal behind `path_`.
class SerialPortTest : public testing::Test {
 protected:
  /// What the device sends.
  void send(const std::string& text) {
    ASSERT_EQ(write(terminal_.descriptor(), text.data(), text.size()), std::ssize(text));
  }
  TemporaryFolder folder_;
  std::string path_ = folder_ / "port";
  PseudoTerminal terminal_{path_};
};

TEST_F(SerialPortTest, TakesTheBoardsOddBaudRateAndNoModemLines) {
  const SerialPort port(path_, {.baud = 7'372'800});  // a pty has no DTR: not an error
  EXPECT_EQ(port.baud(), 7'372'800U);
}

TEST_F(SerialPortTest, SecondOpenerIsRefusedEvenAsRoot) {
  {
    const SerialPort first(path_);
    EXPECT_ERROR(SerialPort second(path_), PortError, "already open, by another program (see `fuser ");
  }
  EXPECT_NO_THROW(SerialPort third(path_));
}

TEST(PortList, ALastingNameIsThatOfTheDevice) {
  const TemporaryFolder folder;
  const PseudoTerminal terminal(folder / "port");
  EXPECT_EQ(lasting_port_name(folder / "port"), folder / "port") << "a pseudo-terminal's number is reused";
  EXPECT_EQ(lasting_port_name("/dev/./null"), "/dev/null");
  std::filesystem::create_directory(folder / "by-id");
  std::filesystem::create_symlink("/dev/none", folder / "by-id/a_gone");
  std::filesystem::create_symlink("/dev/null", folder / "by-id/usb-Printer_7");
  for (const std::string& path : {std::string("/dev/null"), folder / "by-id/usb-Printer_7"})
    EXPECT_EQ(lasting_port_name(path, folder / "by-id"), folder / "by-id/usb-Printer_7");
  EXPECT_EQ(lasting_port_name("/dev/zero", folder / "by-id"), "/dev/zero");
}

TEST(SerialPort, WhatCannotBeOpenedSaysWhy) {
  const TemporaryFolder folder;
  EXPECT_ERROR(SerialPort port(folder / "nothing"), PortError,
               (folder / "nothing") + ": no such port; plug the device in, or run supertac-check machine");
  std::ofstream(folder / "file") << "text";
  EXPECT_ERROR(SerialPort port(folder / "file"), PortError,
               "expected a serial port, found another kind of file; run supertac-check machine");
}

// A user without rights on the port; root first becomes nobody.
TEST_F(SerialPortTest, WithoutPermissionTheGroupIsNamed) {
  ASSERT_EQ(chmod(terminal_.path().c_str(), 0), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    int code = 1;
    if (geteuid() == 0 && setuid(65534) != 0) _exit(2);
    try {
      const SerialPort port(terminal_.path());
    } catch (const PortError& error) {
      code = std::string(error.what()).find("dialout") != std::string::npos ? 0 : 3;
    }
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(SerialPortTest, WhatCameBeforeItWasOpenedIsNotTakenForNew) {
  SerialPort{path_};  // a pseudo-terminal keeps what comes once somebody has opened it
  send("old");
  SerialPort port(path_);
  send("new");
  std::array<std::byte, 16> buffer{};
  ASSERT_EQ(port.read(buffer, port.now() + 1).count, 3U);
  EXPECT_EQ(buffer[0], std::byte{'n'});
}

TEST_F(SerialPortTest, TimeOutAndEndOfFileAreDifferent) {
  SerialPort port(path_);
  std::array<std::byte, 16> buffer{};
  EXPECT_EQ(port.read(buffer, port.now() + 0.02).count, 0U);
  send("last");
  terminal_.unplug();
  EXPECT_THROW(
      {
        for (int i = 0; i < 3; ++i) (void)port.read(buffer, port.now() + 1);
      },
      PortUnplugged);
  EXPECT_ERROR(port.write(std::as_bytes(std::span("x")), port.now() + 1), PortUnplugged,
               "check the cable and start again, nothing is resumed");
}

// Within 100 ms: bench/results/rig/unplug.csv. Here it is noticed at all, before the wait is over.
TEST(SerialPort, UnpluggingEndsTheWait) {
  for (int i = 0; i < 20; ++i) {
    const TemporaryFolder folder;
    PseudoTerminal terminal(folder / "port");
    SerialPort port(folder / "port");
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      terminal.unplug();
    });
    std::array<std::byte, 16> buffer{};
    EXPECT_ERROR((void)port.read(buffer, port.now() + 100), PortUnplugged, "the device is gone (");
    other.join();
  }
}

TEST_F(SerialPortTest, AFullDeviceIsATimeOut) {
  SerialPort port(path_);
  const std::vector<std::byte> much(1 << 20);
  EXPECT_ERROR(port.write(much, port.now() + 0.05), PortTimeout,
               "the device took no bytes before the deadline (");
}

// Partial writes, EAGAIN and EINTR: a slow reader, and a signal every 200 us without SA_RESTART.
TEST_F(SerialPortTest, OutputIsByteExactUnderAStormOfSignals) {
  SerialPort port(path_);
  std::vector<std::byte> sent(200'000);
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<std::byte>(i * 131 >> 3);

  struct sigaction quiet {};
  quiet.sa_handler = [](int) {};
  struct sigaction before {};
  sigaction(SIGALRM, &quiet, &before);
  const itimerval storm{{0, 200}, {0, 200}};
  setitimer(ITIMER_REAL, &storm, nullptr);

  std::vector<std::byte> got;
  std::thread reader([&] {
    std::array<std::byte, 777> buffer{};
    const double until = monotonic_seconds() + 30;
    while (got.size() < sent.size() && monotonic_seconds() < until) {
      const ssize_t count = read(terminal_.descriptor(), buffer.data(), buffer.size());
      if (count > 0) got.insert(got.end(), buffer.begin(), buffer.begin() + count);
      if (count < 0) std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  });
  EXPECT_NO_THROW(port.write(sent, port.now() + 30));
  reader.join();
  const itimerval off{};
  setitimer(ITIMER_REAL, &off, nullptr);
  sigaction(SIGALRM, &before, nullptr);
  EXPECT_EQ(got, sent);
}

}  // namespace supertac::serial_port_test
