// Everything that can go wrong with a device, as types: a program decides by type, a person reads what().
// Every message names the port, what was expected, what was found, and the next step.
#pragma once

#include <stdexcept>

namespace supertac {

/// Base of all device errors.
struct HardwareError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// --- ports ---------------------------------------------------------------------------------------
/// The port could not be opened or configured.
struct PortError : HardwareError {
  using HardwareError::HardwareError;
};
struct PortNotFound : PortError {
  using PortError::PortError;
};
struct PortPermission : PortError {
  using PortError::PortError;
};
/// Another program (or another part of this one) holds the port.
struct PortBusy : PortError {
  using PortError::PortError;
};
struct NotASerialPort : PortError {
  using PortError::PortError;
};
/// The port works, but the device behind it is not the expected one.
struct WrongDevice : PortError {
  using PortError::PortError;
};
/// End of file: the device is gone (POLLHUP, read 0, EIO, ENXIO). Never resumed silently.
struct PortUnplugged : PortError {
  using PortError::PortError;
};
/// The device is there but a deadline passed.
struct PortTimeout : PortError {
  using PortError::PortError;
};

// --- printer -------------------------------------------------------------------------------------
struct PrinterError : HardwareError {
  using HardwareError::HardwareError;
};
/// No valid answer within the deadline, after all repetitions.
struct PrinterSilent : PrinterError {
  using PrinterError::PrinterError;
};
/// The firmware restarted while in use: its position is unknown.
struct PrinterReset : PrinterError {
  using PrinterError::PrinterError;
};
/// kill(), halt or a thermal error: nothing more may be sent.
struct PrinterHalted : PrinterError {
  using PrinterError::PrinterError;
};
/// The firmware asked for the same line too often, or for one that is no longer kept.
struct ResendLoop : PrinterError {
  using PrinterError::PrinterError;
};
struct PrinterPaused : PrinterError {
  using PrinterError::PrinterError;
};
/// The firmware ran the line but reported an error for it.
struct PrinterRefused : PrinterError {
  using PrinterError::PrinterError;
};
/// A target or the way to it leaves the permitted space; nothing was sent.
struct OutsideLimits : PrinterError {
  using PrinterError::PrinterError;
};
/// Neither homed nor confirmed by the operator; nothing was sent.
struct OriginUnknown : PrinterError {
  using PrinterError::PrinterError;
};
/// The head is not where it was sent, or did not get there in time.
struct PositionError : PrinterError {
  using PrinterError::PrinterError;
};
/// A stop was sent but the head could not be shown to stand still.
struct StopUnconfirmed : PrinterError {
  using PrinterError::PrinterError;
};

// --- board and run -------------------------------------------------------------------------------
/// The board is connected but sends no frames.
struct BoardSilent : HardwareError {
  using HardwareError::HardwareError;
};
/// The operator asked to stop.
struct OperatorStop : HardwareError {
  using HardwareError::HardwareError;
};
/// A replay was asked for bytes other than those recorded.
struct ReplayDiverged : HardwareError {
  using HardwareError::HardwareError;
};
/// The journal of a collection cannot be written or read.
struct JournalError : HardwareError {
  using HardwareError::HardwareError;
};

}  // namespace supertac
