// A page that a program shows of itself, in a browser on the same computer.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

struct MHD_Daemon;

namespace supertac {

class Arguments;

/// What is served. The functions are called on the server's thread alone.
struct WebSite {
  /// GET /
  std::string_view page;
  /// GET /events, server-sent: first an event "hello" with this JSON object, to which "token" is added; an
  /// event "still" each second until there are news ...
  std::function<std::string()> hello;
  /// ... then the newest of these JSON texts, at most 30 a second, and again each second without another; an
  /// empty text: there is nothing new.
  std::function<std::string()> news;
  /// POST /NAME does what its name says and answers with a line for people.
  std::map<std::string, std::function<std::string()>, std::less<>> actions;
};

struct WebAddress {
  std::uint16_t port = 8080;       ///< 0: any that is free
  std::string bind = "127.0.0.1";  ///< numeric; another than 127.0.0.1 is open to the network
  bool is_loopback() const { return bind == "127.0.0.1"; }
};

/// Declares --web.
void declare_web(Arguments& a);
/// Where the page is served; nothing without --web. Warns when the network may see it. Throws UsageError.
std::optional<WebAddress> web_address(const Arguments& a);

/// Serves a site from a thread of its own. Nobody who publishes waits for a reader: a page that is too slow
/// misses events, and one that takes nothing for 20 s is closed. Who comes when there are kMostPeers already
/// is let in all the same: of those a silent one leaves, else the page that is behind, else the oldest.
///
/// Who may come in: a Host other than this computer's names for itself, at any port (of a tunnel), gets 421
/// (a foreign name that was made to resolve to it), a foreign Origin 403, and an action needs the token that
/// only a page of this server has read, else 403. Bodies of requests are not read.
class WebServer {
 public:
  static constexpr std::size_t kMostPeers = 200;
  static constexpr double kMostEventsPerS = 30, kFarewellS = 0.5;

  /// Throws std::runtime_error when the address cannot be had.
  WebServer(const WebAddress& address, WebSite site);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// "http://127.0.0.1:8080"
  std::string url() const;
  /// What became of the run: the last that pages hear, when this is destroyed, which waits kFarewellS at most
  /// until all have it. At most once.
  void end(const std::string& outcome, bool failed);

 private:
  friend struct WebRequest;
  struct Peer;

  void run();
  void publish();
  void make_room();
  void say_farewell();
  std::string first_event() const;

  WebAddress address_;
  WebSite site_;
  std::string token_;
  MHD_Daemon* daemon_ = nullptr;
  std::string newest_ = "event: still\ndata: 1\n\n";  // as it is sent
  std::string farewell_;                              // likewise; read when stop_ is set
  std::uint64_t number_ = 0;
  double told_s_ = 0;
  std::list<Peer> peers_;  // in the order of their coming
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace supertac
