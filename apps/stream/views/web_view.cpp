#include "apps/stream/views/web_view.h"

#include "apps/web/pages.h"
#include "data/map/named_map.h"
#include "hardware/ports/serial_port.h"

namespace supertac {

constexpr double kSurfaceEveryS = 1;

WebView::WebView(const WebAddress& address, nlohmann::json hello, std::function<NamedMap(MapCells)> surface,
                 Recorder& recorder, PressedOrder* order)
    : hello_(std::move(hello)),
      of_surface_(std::move(surface)),
      recorder_(recorder),
      order_(order),
      server_(address, site()) {}

WebSite WebView::site() {
  WebSite site{.page = live_page(),
               .hello = [this] { return hello(); },
               .news = [this] { return news(); },
               .actions = {{"rezero",
                            [this] {
                              rezero_ = true;
                              return std::string("what the array feels now counts as nothing");
                            }},
                           {"record", [this] { return recorder_.start(); }},
                           {"stop", [this] { return recorder_.stop(); }}}};
  if (order_ == nullptr) return site;
  // Begun or left as it is here: the page's newest event may be older than its last answer.
  site.actions["order"] = [this] { return order_->status().asked ? order_->leave() : order_->start(); };
  site.actions["skip"] = [this] { return order_->skip(); };
  site.actions["leave"] = [this] { return order_->leave(); };
  return site;
}

bool WebView::update(const LiveState& state, const SurfaceMap* map, const MapRegion& changed) {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return false;
  newest_ = state;
  if (map == nullptr) return true;
  untold_ = tell_all_ ? map->felt() : untold_.with(changed);
  tell_all_ = false;
  newest_->map = map->cells(untold_);
  if (const double now = monotonic_seconds(); now - surface_s_ >= kSurfaceEveryS)
    surface_s_ = now, surface_ = map->cells(map->felt());
  return true;
}

std::string WebView::hello() {
  const std::lock_guard lock(mutex_);
  tell_all_ = true;
  return dumped(hello_);
}

std::string WebView::news() {
  std::optional<LiveState> state;
  MapCells surface;
  {
    const std::lock_guard lock(mutex_);
    state.swap(newest_);
    untold_ = {};
    if (state) std::swap(surface, surface_);
  }
  if (!surface.region.empty()) state->surface = of_surface_(std::move(surface));
  return state ? web_event(*state, recorder_.status()) : std::string();
}

std::string web_event(const LiveState& state, const Recorder::Status& recorder) {
  nlohmann::json event = {{"n", state.number},
                          {"t", state.time_s},
                          {"rate", state.frames_per_s},
                          {"p50", state.median_ms},
                          {"p99", state.p99_ms},
                          {"lost", state.lost},
                          {"dropped", state.dropped},
                          {"said", recorder.said},
                          {"recording", recorder.recording},
                          {"recorded_s", recorder.seconds}};
  if (!state.taxels.empty()) event["felt"] = levels_base64(state.taxels), event["top"] = state.top;
  if (const auto& most = state.most_changed)
    event["most"] = {
        {"taxel", most->taxel}, {"channel", most->channel}, {"rest", most->rest}, {"now", most->now}};
  if (state.order.asked) event["asked"] = *state.order.asked;
  if (!state.order.says.empty()) event["order"] = state.order.says;
  if (!state.picture.empty()) event["picture"] = levels_base64(state.picture);
  if (!state.half_widths.empty()) event["wide"] = levels_base64(state.half_widths);
  if (state.distance) event["distance"] = *state.distance, event["unlike"] = state.unlike_training;
  if (std::isfinite(state.x_mm)) event["x"] = state.x_mm, event["y"] = state.y_mm;
  if (const MapRegion& r = state.map.region; !r.empty()) {
    std::vector<std::uint8_t> known;
    for (const float value : state.map.values) known.push_back(std::isnan(value) ? 0 : 1);
    event["map"] = {{"left", r.left},
                    {"bottom", r.bottom},
                    {"width", r.width},
                    {"values", levels_base64(state.map.values)},
                    {"known", base64(known)}};
  }
  if (state.surface) {
    event["elements"] = {{"text", elements_text(*state.surface)}, {"rows", nlohmann::json::array()}};
    for (const Element& element : elements(*state.surface))
      for (auto& row = event["elements"]["rows"].emplace_back();
           const auto& [name, value] : numbers_of(element))
        row[name] = value;
  }
  return dumped(event);
}

}  // namespace supertac
