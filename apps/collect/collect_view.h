// A collection in a browser.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "apps/web/web_server.h"
#include "data/plates/plate.h"
#include "hardware/collection/palpation_recorder.h"

namespace supertac {

/// Serves collect_page(): the plan, the plate with the finger on it, and one action, "stop", which does what
/// Ctrl-C does. Nothing begins or moves anything.
class CollectView {
 public:
  /// `source` names ports and folder. Throws as WebServer.
  CollectView(const WebAddress& address, const Plate& plate, const Bed& bed, double speedup,
              const std::string& source);

  /// Never waits.
  void update(const Leg& leg, const Point3& at, const ReaderCounters& board);
  std::string url() const { return server_.url(); }
  /// As WebServer.
  void end(const std::string& outcome, bool failed) { server_.end(outcome, failed); }

 private:
  struct State {
    Leg leg;
    Point3 at;
    ReaderCounters board;
  };
  WebSite site();
  std::string hello() const;
  std::string news();

  const Plate plate_;
  Bed bed_;
  std::vector<Leg> legs_;
  double speedup_;
  std::string source_;
  std::mutex mutex_;
  std::optional<State> newest_;
  WebServer server_;  // last: its thread uses the others
};

}  // namespace supertac
