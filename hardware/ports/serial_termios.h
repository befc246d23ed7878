// Raw terminal settings through TCSETS2, which takes any baud rate (the board's 7,372,800 has no B constant).
// Apart from serial_port.cpp because <asm/termbits.h> and <termios.h> cannot be included together.
#pragma once

namespace supertac {

constexpr unsigned kLeastBaud = 50, kMostBaud = 100'000'000;

/// Eight bits, no parity, no flow control, no translation, `baud` in both directions.
/// Returns 0 or the errno of the call that failed.
int set_raw_terminal(int descriptor, unsigned baud);

/// Baud rate as the terminal reports it, 0 when it does not.
unsigned terminal_baud(int descriptor);

}  // namespace supertac
