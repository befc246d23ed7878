// The live picture in a browser.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/stream/live_frame.h"
#include "apps/stream/picture_log.h"
#include "apps/web/web_server.h"

namespace supertac {

/// Serves live_page() with the newest state, 30 times a second at most, from a thread of its own.
class WebView {
 public:
  /// `hello`: what page.js is told first. `surface`: what the map's cells say; called from another thread.
  /// `recorder` and `order`, of a page of a probe, must outlive this. Throws as WebServer.
  WebView(const WebAddress& address, nlohmann::json hello, std::function<NamedMap(MapCells)> surface,
          Recorder& recorder, PressedOrder* order);

  /// Never waits: a state that comes while the server takes the one before is left out, and false returned.
  /// `map`: null where there is none; `changed`: its region since the last that was taken. A page that comes
  /// has all of it told anew.
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

  nlohmann::json hello_;
  std::function<NamedMap(MapCells)> of_surface_;
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
