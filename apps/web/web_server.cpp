#include "apps/web/web_server.h"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/random.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "apps/common/command_line/arguments.h"
#include "apps/web/pages.h"
#include "io/numbers/clock.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr unsigned kStalledS = 20;
constexpr double kToAskS = 0.5;                                // of a new connection
constexpr unsigned kConnections = WebServer::kMostPeers + 56;  // those that are asked to leave still count
constexpr std::size_t kRequestBytes = 16 << 10;  // memory of a connection; more than that gets 431
constexpr int kSendBuffer = 64 << 10;            // what a stalled page may leave unread, and show late
constexpr double kStillHereS = 1;
constexpr std::string_view kPolicy =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; worker-src 'self'; "
    "connect-src 'self'; "
    "img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

double seconds_now() { return seconds_of(CLOCK_MONOTONIC); }

std::string random_token() {
  std::array<std::uint8_t, 18> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("web: the system gives no random numbers");
  return base64(bytes);
}

[[noreturn]] void cannot_serve(const WebAddress& address, const std::string& problem) {
  throw std::runtime_error("web: " + in_quotes(address.bind) + " port " + std::to_string(address.port) +
                           ": " + problem);
}

sockaddr_in place_of(const WebAddress& address) {
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(address.port);
  if (inet_pton(AF_INET, address.bind.c_str(), &place.sin_addr) != 1)
    cannot_serve(address, "expected a numeric address of this computer, such as 127.0.0.1 or 0.0.0.0");
  return place;
}

std::string_view header(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

/// "localhost" of "localhost:8080"; empty for what is no port.
std::string host_without_port(std::string_view host) {
  const std::size_t colon = host.find(':');
  const std::string_view port = host.substr(colon == host.npos ? host.size() : colon);
  const bool fits = port.empty() || (port.size() <= 6 && parse_uint(port.substr(1)).value_or(0) > 0);
  return std::string(fits ? host.substr(0, colon) : "");
}

bool is_numeric(const std::string& host) {
  in_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1;
}

}  // namespace

void declare_web(Arguments& a) {
  a.option_alone("web", "[ADDRESS:]PORT",
                 "show a live page in a browser on this computer (default port 8080), or with an address "
                 "(0.0.0.0 for all) to the network, its buttons included",
                 "8080");
}

std::optional<WebAddress> web_address(const Arguments& a) {
  if (!a.given("web")) return std::nullopt;
  const std::string text = a.text("web");
  const std::size_t port_at = text.find(':') + 1;  // 0 where there is no address
  WebAddress address;
  if (port_at > 0) address.bind = text.substr(0, port_at - 1);
  const auto port = parse_uint(text.substr(port_at));
  if (!port || *port > 65535)
    throw UsageError("--web: expected PORT or ADDRESS:PORT with a port from 0 to 65535, found " +
                     in_quotes(text));
  address.port = static_cast<std::uint16_t>(*port);
  if (!address.is_loopback())
    a.note("warning: --web " + text +
           ": everybody who reaches this computer may watch, and press the page's buttons");
  return address;
}

/// An open connection, and what a page that gets events has heard.
struct WebServer::Peer {
  WebServer& server;
  MHD_Connection* connection;
  double came_s;
  bool asks = false;    // a request is being answered
  bool leaves = false;  // it was told to
  bool reads = false;   // events
  bool waits = false;   // has taken the newest one
  std::uint64_t seen = 0;
  std::string left = {};  // of an event that has not been taken whole

  static Peer& of(MHD_Connection* connection) {
    return *static_cast<Peer*>(
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context);
  }
  static void come_or_go(void* self, MHD_Connection* connection, void** peer,
                         MHD_ConnectionNotificationCode code) {
    auto& server = *static_cast<WebServer*>(self);
    if (code == MHD_CONNECTION_NOTIFY_STARTED)
      *peer = &server.peers_.emplace_back(Peer{server, connection, seconds_now()});
    else
      server.peers_.remove_if([peer](const Peer& p) { return &p == *peer; });
  }
  static void has_answer(void*, MHD_Connection* connection, void**, MHD_RequestTerminationCode) {
    of(connection).asks = false;
  }
  static ssize_t read(void* self, std::uint64_t, char* buffer, std::size_t most) {
    return static_cast<Peer*>(self)->take(buffer, most);
  }

  ssize_t take(char* buffer, std::size_t most) {
    reads = true;
    if (leaves) return MHD_CONTENT_READER_END_WITH_ERROR;
    if (left.empty() && server.number_ > seen) {
      left = server.newest_;
      seen = server.number_;
    }
    if (left.empty()) {
      waits = true;
      MHD_suspend_connection(connection);
      return 0;
    }
    const std::size_t count = left.copy(buffer, most);
    left.erase(0, count);
    return static_cast<ssize_t>(count);
  }
  void wake() {
    if (std::exchange(waits, false)) MHD_resume_connection(connection);
  }
};

/// One request, answered when its headers are known.
struct WebRequest {
  WebServer& server;
  MHD_Connection* connection;
  std::string_view path, method;

  static MHD_Result handle(void* server, MHD_Connection* connection, const char* url, const char* method,
                           const char*, const char*, std::size_t*, void**) {
    try {
      WebServer::Peer::of(connection).asks = true;
      return WebRequest{*static_cast<WebServer*>(server), connection, url, method}.answer();
    } catch (const std::exception&) {
      return MHD_NO;  // closes the connection
    }
  }

  MHD_Result answer() {
    if (!is_own_host())
      return text(421, "this program serves its own computer; open the address that it printed");
    const std::string_view origin = header(connection, "Origin");
    if (!origin.empty() && origin != "http://" + std::string(header(connection, "Host")))
      return text(403, "the request comes from another page");
    if (method == "POST") return act();
    if (method != "GET" && method != "HEAD") return text(405, "expected GET or POST");
    if (path == "/") return text(200, server.site_.page, "text/html; charset=utf-8");
    if (path == "/link.js") return text(200, link_script(), "text/javascript; charset=utf-8");
    if (path == "/events") return events();
    return text(404, "there is nothing of this name");
  }

  // Names of this computer only: a foreign name that resolves to it belongs to a foreign page. An address
  // that the network may use is open to numbers, which no foreign page can claim.
  bool is_own_host() const {
    const std::string name = host_without_port(header(connection, "Host"));
    return name == "localhost" || name == "127.0.0.1" || (!server.address_.is_loopback() && is_numeric(name));
  }

  MHD_Result act() {
    const auto action = server.site_.actions.find(path.substr(std::min<std::size_t>(1, path.size())));
    if (action == server.site_.actions.end()) return text(404, "there is no such action");
    if (header(connection, "Origin").empty() || header(connection, "X-Token") != server.token_)
      return text(403, "an action needs the page's token; load the page again");
    return text(200, action->second());
  }

  MHD_Result events() {
    WebServer::Peer& peer = WebServer::Peer::of(connection);
    peer.left = server.first_event();
    return send(
        200, "text/event-stream",
        MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 4096, &WebServer::Peer::read, &peer, nullptr));
  }

  MHD_Result text(unsigned status, std::string_view body, const char* type = "text/plain; charset=utf-8") {
    return send(
        status, type,
        MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()), MHD_RESPMEM_MUST_COPY));
  }

  MHD_Result send(unsigned status, const char* type, MHD_Response* response) {
    if (response == nullptr) return MHD_NO;
    for (const auto& [name, value] : {std::pair("Content-Type", type),
                                      {"Cache-Control", "no-store"},
                                      {"X-Content-Type-Options", "nosniff"},
                                      {"Referrer-Policy", "no-referrer"},
                                      {"Cross-Origin-Resource-Policy", "same-origin"},
                                      {"Content-Security-Policy", kPolicy.data()}})
      MHD_add_response_header(response, name, value);
    // No page keeps a connection for its next wish, which a sleep would leave dead.
    if (status != 200 || std::string_view(type) != "text/event-stream")
      MHD_add_response_header(response, "Connection", "close");
    const MHD_Result result = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return result;
  }
};

WebServer::WebServer(const WebAddress& address, WebSite site)
    : address_(address), site_(std::move(site)), token_(random_token()) {
  const sockaddr_in place = place_of(address_);
  // Not with epoll: it would see no end of a connection that was closed behind half a request.
  daemon_ = MHD_start_daemon(MHD_ALLOW_SUSPEND_RESUME, 0, nullptr, nullptr, &WebRequest::handle, this,
                             MHD_OPTION_SOCK_ADDR, &place, MHD_OPTION_CONNECTION_LIMIT, kConnections,
                             MHD_OPTION_CONNECTION_TIMEOUT, kStalledS, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
                             kRequestBytes, MHD_OPTION_NOTIFY_CONNECTION, &Peer::come_or_go, this,
                             MHD_OPTION_NOTIFY_COMPLETED, &Peer::has_answer, nullptr, MHD_OPTION_END);
  if (daemon_ == nullptr)
    cannot_serve(address_, std::string(strerror(errno)) + "; choose another port with --web PORT");
  address_.port = MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_BIND_PORT)->port;
  const int listening = MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_LISTEN_FD)->listen_fd;
  setsockopt(listening, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);  // connections inherit it
  thread_ = std::thread([this] { run(); });
}

WebServer::~WebServer() {
  stop_ = true;
  thread_.join();
}

std::string WebServer::url() const { return "http://" + address_.bind + ":" + std::to_string(address_.port); }

void WebServer::end(const std::string& outcome, bool failed) {
  farewell_ = "event: end\ndata: " + dumped({{"outcome", outcome}, {"failed", failed}}) + "\n\n";
}

std::string WebServer::first_event() const {
  std::string hello = site_.hello();
  hello.insert(1, "\"token\":\"" + token_ + "\",");
  return "retry: 1000\nevent: hello\ndata: " + hello + "\n\n";
}

// The newest event is told again after a second without another: a page that hears nothing for longer knows
// that the program is gone, and the program finds out about pages that are.
void WebServer::publish() {
  const double now = seconds_now();
  if (std::string news = site_.news(); !news.empty()) {
    newest_ = "data: " + news + "\n\n";
  } else if (now - told_s_ < kStillHereS) {
    return;
  }
  ++number_;
  told_s_ = now;
  for (Peer& peer : peers_) peer.wake();
}

// Many that come and say nothing, or take nothing, must not keep out the one who works here. Whoever has just
// come has not had the time to ask.
void WebServer::make_room() {
  const double now = seconds_now();
  const auto rank = [&](const Peer& p) {  // of the lowest the oldest leaves
    if (p.leaves) return 4;
    if (!p.asks && now - p.came_s > kToAskS) return 0;
    if (p.reads && number_ > p.seen + static_cast<std::uint64_t>(kMostEventsPerS)) return 1;
    return !p.asks && &p != &peers_.back() ? 2 : 3;
  };
  for (auto open = std::ranges::count(peers_, false, &Peer::leaves);
       open > static_cast<std::ptrdiff_t>(kMostPeers); --open) {
    const auto peer = std::ranges::min_element(peers_, {}, rank);
    peer->leaves = true;
    shutdown(MHD_get_connection_info(peer->connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd,
             SHUT_RDWR);
    peer->wake();
  }
}

// A page may come late, a frame may not: this thread leaves a priority to the others. Stop may not either, so
// that it stands behind nobody else.
void WebServer::run() {
  const sched_param none{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
  double due = seconds_now();
  while (!stop_) {
    const double now = seconds_now();
    if (now >= due) {
      publish();
      due = std::max(due + 1 / kMostEventsPerS, now);
    }
    const auto wait_ms = static_cast<int>(1e3 * std::max(0.0, due - seconds_now()));
    if (MHD_run_wait(daemon_, std::max(1, wait_ms)) == MHD_NO) break;
    make_room();
  }
  if (!farewell_.empty()) say_farewell();
  for (Peer& peer : peers_) peer.wake();
  MHD_stop_daemon(daemon_);
}

// A page that has taken the farewell waits for more.
void WebServer::say_farewell() {
  newest_ = farewell_;
  ++number_;
  for (Peer& peer : peers_) peer.wake();
  const auto has_more = [](const Peer& p) { return p.reads && !p.waits; };
  for (const double until = seconds_now() + kFarewellS;
       std::ranges::any_of(peers_, has_more) && seconds_now() < until;)
    if (MHD_run_wait(daemon_, 10) == MHD_NO) return;
}

}  // namespace supertac
