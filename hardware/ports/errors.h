// Everything that can go wrong with a device, as types: a program decides by type, a person reads what().
// A message names the port, what was expected, what was found, and the next step where there is one to take.
#pragma once

#include <stdexcept>

namespace supertac {

#define SUPERTAC_ERROR(Name, Base) \
  struct Name : Base {             \
    using Base::Base;              \
  }

struct HardwareError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A port could not be opened or configured.
SUPERTAC_ERROR(PortError, HardwareError);
SUPERTAC_ERROR(WrongDevice, PortError);    ///< it works, but another device is behind it
SUPERTAC_ERROR(PortUnplugged, PortError);  ///< end of file (POLLHUP, read 0, EIO, ENXIO); never resumed
SUPERTAC_ERROR(PortEnded, PortUnplugged);  ///< end of a file or pipe, which may end
SUPERTAC_ERROR(PortTimeout, PortError);    ///< the device is there, but a deadline passed

// The printer.
SUPERTAC_ERROR(PrinterError, HardwareError);
SUPERTAC_ERROR(PrinterSilent, PrinterError);   ///< no valid answer in time, after all repetitions
SUPERTAC_ERROR(PrinterReset, PrinterError);    ///< restarted while in use: its position is unknown
SUPERTAC_ERROR(PrinterHalted, PrinterError);   ///< kill(), halt, thermal: nothing more may be sent
SUPERTAC_ERROR(ResendLoop, PrinterError);      ///< asks for a line too often, or for one no longer kept
SUPERTAC_ERROR(PrinterPaused, PrinterError);   ///< waits for its user at its display
SUPERTAC_ERROR(PrinterRefused, PrinterError);  ///< ran the line but reported an error for it
SUPERTAC_ERROR(OutsideLimits, PrinterError);   ///< a target or the way to it; nothing was sent
SUPERTAC_ERROR(OriginUnknown, PrinterError);   ///< neither homed nor confirmed; nothing was sent
SUPERTAC_ERROR(PositionError, PrinterError);   ///< the head is not where it was sent, or came too late

// Board, run and journal.
SUPERTAC_ERROR(BoardSilent, HardwareError);     ///< connected, but sends no frames
SUPERTAC_ERROR(OperatorStop, HardwareError);    ///< the operator asked to end the run
SUPERTAC_ERROR(ReplayDiverged, HardwareError);  ///< asked for bytes other than those recorded
SUPERTAC_ERROR(JournalError, HardwareError);    ///< cannot be written, or is none

#undef SUPERTAC_ERROR

}  // namespace supertac
