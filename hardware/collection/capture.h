// Raw capture and replay. A captured port writes everything that passes, with its times, to a journal; a
// replayed port gives the same bytes at the same times to the same drivers, which then do exactly the same
// again.
#pragma once

#include <memory>
#include <vector>

#include "hardware/collection/journal.h"
#include "hardware/ports/port.h"

namespace supertac {

class CapturedPort : public Port {
 public:
  /// `journal` must outlive the port.
  CapturedPort(std::unique_ptr<Port> port, JournalWriter& journal, JournalStream stream);
  const std::string& name() const override { return port_->name(); }
  unsigned baud() const override { return port_->baud(); }
  double now() override;
  Received read(std::span<std::byte> buffer, double until) override;
  double write(std::span<const std::byte> bytes, double until) override;

 private:
  std::unique_ptr<Port> port_;
  JournalWriter& journal_;
  JournalStream stream_;
};

class ReplayPort : public Port {
 public:
  /// Throws PortEnded at the end of the records, ReplayDiverged when the driver does something else than
  /// was recorded, JournalError when it does because of the damage to the journal, `lost_bytes`.
  ReplayPort(std::vector<JournalRecord> records, std::string name, std::uint64_t lost_bytes = 0);
  const std::string& name() const override { return name_; }
  double now() override;
  Received read(std::span<std::byte> buffer, double until) override;
  double write(std::span<const std::byte> bytes, double until) override;

 private:
  const JournalRecord& next(RecordKind expected);
  [[noreturn]] void diverged(const std::string& found, const std::string& done) const;
  std::vector<JournalRecord> records_;
  std::string name_;
  std::uint64_t lost_bytes_;
  std::size_t at_ = 0;
  std::size_t taken_ = 0;  // bytes of records_[at_] already given
};

}  // namespace supertac
