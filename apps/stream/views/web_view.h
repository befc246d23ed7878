// The live picture in a browser.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "apps/stream/live_state.h"
#include "apps/stream/recorder.h"
#include "apps/web/web_server.h"

namespace supertac {

/// What a page shows besides the pictures, and what never changes.
struct WebSource {
  std::string badge;   ///< "board", "virtual rig", "replay", "recording"
  std::string source;  ///< which
  TaxelArray array;
  int scale = 4;
  bool predicts_error = false;
  std::string unit = {};                           ///< of the signals
  bool draws = false;                              ///< there is a model
  double delay_s = 0;                              ///< of its pictures
  std::vector<int> silent = {};                    ///< taxels that say nothing
  std::vector<std::string> found = {};             ///< by a probe, a line each
  std::function<NamedMap(MapCells)> surface = {};  ///< what the map's cells say; from another thread
};

/// Serves live_page() with the newest state, 30 times a second at most, from a thread of its own.
class WebView {
 public:
  /// `recorder` and `order`, of a page of a probe, must outlive this. Throws as WebServer.
  WebView(const WebAddress& address, const WebSource& source, Recorder& recorder, PressedOrder* order);

  /// Never waits: a state that comes while the server takes the one before is left out, and false returned.
  /// `changed`: region of the map (null: there is none) since the last that was taken. A page that comes
  /// makes all of it told anew.
  bool update(const LiveState& state, const SurfaceMap* map = nullptr, const MapRegion& changed = {});
  /// Whether somebody has wished to re-zero since the last call.
  bool take_rezero() { return rezero_.exchange(false); }
  std::string url() const { return server_.url(); }
  /// As WebServer.
  void end(const std::string& outcome, bool failed) { server_.end(outcome, failed); }

 private:
  WebSite site();
  std::string hello();
  std::string news();

  WebSource source_;
  Recorder& recorder_;
  PressedOrder* order_;
  std::atomic<bool> rezero_{false};
  std::mutex mutex_;
  std::optional<LiveState> newest_;
  MapRegion untold_;  // of the map
  bool tell_all_ = true;
  double surface_s_ = 0;  // when all of it was taken
  MapCells surface_;      // empty: told already
  WebServer server_;      // last: its thread uses the others
};

/// The event of a state, one line of JSON; pictures as levels_base64().
std::string web_event(const LiveState& state, const Recorder::Status& recorder);

}  // namespace supertac
