// The server of the live page: who may come in, what leaves, and what a slow reader costs.
#include <sys/resource.h>
#include <cstdlib>
#include <random>

#include <atomic>
#include <chrono>
#include <fstream>

#include "apps/stream/views/web_view.h"
#include "apps/web/pages.h"
#include "apps/web/web_server.h"
#include "io/files/json.h"
#include "io/images/images.h"
#include "tests/apps/common/expect.h"
#include "tests/apps/web/http_client.h"
#include "tests/fuzz/corpus.h"
#include "tests/support/test.h"

namespace supertac::web_test {

TEST(Encode, Base64IsThatOfRfc4648) {
  const auto encoded = [](std::string_view text) {
    return base64(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  };
  EXPECT_EQ(encoded(""), "");
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
  EXPECT_EQ(levels_base64(std::vector<float>{0, 1, 0.5F}), "AP+A");
  EXPECT_EQ(levels_base64(std::vector<float>{-1, 2, std::nanf("")}), "AP8A");
}

TEST(Encode, TheMapHasTheColoursOfPictures) {
  const Rgb first = colour_of(0), last = colour_of(1);
  const std::string map = colour_map_base64();
  EXPECT_EQ(map.size(), 1024U);
  EXPECT_TRUE(map.starts_with(base64(first)));
  EXPECT_TRUE(map.ends_with(base64(last)));
}

class Web : public testing::Test {
 protected:
  Web() : server_({.port = 0}, site()), port_(std::stoi(server_.url().substr(17))) {}

  WebSite site() {
    return {.page = live_page(),
            .hello = [] { return std::string(R"({"badge":"test"})"); },
            .news =
                [this] {
                  return "{\"n\":" + std::to_string(count_++) + ",\"f\":\"" + std::string(letters_, 'x') +
                         "\"}";
                },
            .actions = {{"record", [this] { return ++records_, std::string("recording"); }}}};
  }
  std::string host() const { return "Host: 127.0.0.1:" + std::to_string(port_) + "\r\n"; }
  std::string origin() const { return "Origin: http://127.0.0.1:" + std::to_string(port_) + "\r\n"; }
  void ask_for_events(HttpClient& client) const { client.send("GET /events HTTP/1.1\r\n" + host() + "\r\n"); }
  int get(const std::string& path, const std::string& headers) const {
    return status_of(port_, "GET " + path + " HTTP/1.1\r\n" + headers + "\r\n");
  }
  int get(const std::string& path) const { return get(path, host()); }
  int post(const std::string& path, const std::string& headers) const {
    return status_of(port_, "POST " + path + " HTTP/1.1\r\nContent-Length: 0\r\n" + headers + "\r\n");
  }
  std::string token() const {
    HttpClient client(port_);
    ask_for_events(client);
    const std::string hello = client.receive("\n\n");
    const std::size_t begin = hello.find("\"token\":\"") + 9;
    return hello.substr(begin, hello.find('"', begin) - begin);
  }
  bool answers() const { return get("/") == 200; }

  std::atomic<std::size_t> letters_{0};  // of what fills an event
  std::atomic<int> count_{0}, records_{0};
  WebServer server_;
  int port_;
};

TEST_F(Web, ListensOnLoopbackOnly) {
  std::ifstream table("/proc/net/tcp");
  char hex[16];
  std::snprintf(hex, sizeof hex, ":%04X", static_cast<unsigned>(port_));
  int found = 0;
  for (std::string line; std::getline(table, line);) {
    const std::size_t at = line.find(hex);
    if (at == std::string::npos || line.find(" 0A ") == std::string::npos) continue;  // 0A: listening
    EXPECT_EQ(line.substr(at - 8, 8), "0100007F") << line;
    ++found;
  }
  EXPECT_EQ(found, 1);
  std::ifstream six("/proc/net/tcp6");
  const std::string all{std::istreambuf_iterator<char>(six), {}};
  EXPECT_FALSE(contains(all, std::string(hex) + " 00000000000000000000000000000000:0000 0A"));
}

TEST_F(Web, AForeignHostIsMisdirected) {
  const std::string port = std::to_string(port_);
  for (const std::string& own :
       std::vector<std::string>{"127.0.0.1:" + port, "localhost:" + port, "127.0.0.1", "localhost:9000",
                                "127.0.0.1:1"})  // through a tunnel
    EXPECT_EQ(get("/", "Host: " + own + "\r\n"), 200) << own;
  for (const std::string& foreign : std::vector<std::string>{
           "evil.example:" + port, "", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:" + port + "00", "localhost:x",
           "192.168.0.7:" + port, "127.0.0.1:" + port + ".evil.example", "localhost.:" + port,
           "evil:127.0.0.1:" + port, "localhost:1:2"})
    EXPECT_EQ(get("/events", "Host: " + foreign + "\r\n"), 421) << foreign;
  EXPECT_EQ(status_of(port_, "GET / HTTP/1.0\r\n\r\n"), 421);  // without a host
}

TEST_F(Web, AnActionNeedsOriginAndToken) {
  const std::string right = "X-Token: " + token() + "\r\n";
  EXPECT_EQ(post("/record", host() + right), 403);  // no origin: not from a page
  EXPECT_EQ(post("/record", host() + origin()), 403);
  EXPECT_EQ(post("/record", host() + origin() + "X-Token: x\r\n"), 403);
  EXPECT_EQ(post("/record", host() + "Origin: http://evil.example\r\n" + right), 403);
  EXPECT_EQ(post("/record", host() + "Origin: null\r\n" + right), 403);
  EXPECT_EQ(get("/record"), 404);
  EXPECT_EQ(get("/", host() + "Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(records_, 0);
  EXPECT_EQ(post("/record", host() + origin() + right), 200);
  EXPECT_EQ(post("/move", host() + origin() + right), 404);
  EXPECT_EQ(records_, 1);
}

TEST_F(Web, NoPathLeavesThePage) {
  for (const char* path : {"/files/a.safetensors", "/..%2fa.safetensors", "/../etc/passwd", "//etc/passwd",
                           "/files//etc/passwd", "/files/%2e%2e/%2e%2e/etc/passwd", "/index.html", "/page.js",
                           "/events/", "/.git/config", "http://127.0.0.1/etc/passwd"})
    EXPECT_NE(get(path), 200) << path;
  for (const char* method : {"PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "BREW"})
    EXPECT_EQ(status_of(port_, std::string(method) + " / HTTP/1.1\r\n" + host() + "\r\n"), 405) << method;
}

TEST_F(Web, ThePageNeedsNothingFromElsewhere) {
  const std::string_view page = live_page();
  for (const char* outside : {"http://", "https://", "src=\"", "@import", "url(", "{{"})
    EXPECT_FALSE(contains(page, outside));
  HttpClient client(port_);
  client.send("GET / HTTP/1.1\r\n" + host() + "\r\n");
  const std::string answer = client.receive("</html>");
  EXPECT_TRUE(contains(answer, "Content-Security-Policy: default-src 'none'"));
  EXPECT_TRUE(contains(answer, page.substr(0, 100)));
}

TEST_F(Web, AReaderGetsTheHelloAndThenTheNewest) {
  HttpClient client(port_);
  ask_for_events(client);
  const std::string first = client.receive("data: {\"n\":");
  EXPECT_TRUE(contains(first, "event: hello\ndata: {\"token\":\""));
  const int begin = count_;
  const auto start = std::chrono::steady_clock::now();
  client.receive("{\"n\":" + std::to_string(begin + 15) + ",");
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_GT(seconds, 0.4);  // at most 30 a second
}

TEST_F(Web, WhoTakesNothingMissesEventsAndHoldsUpNobody) {
  letters_ = 8000;
  HttpClient stalled(port_, 4096), reader(port_);
  ask_for_events(stalled), ask_for_events(reader);
  reader.receive("{\"n\":" + std::to_string(count_ + 60) + ",");
  const int newest = count_;
  EXPECT_GE(newest, 60);
  // What waited for it in buffers, then something recent, none of what lay between.
  const std::string late = stalled.receive("{\"n\":" + std::to_string(newest + 10) + ",");
  int events = 0;
  for (std::size_t at = 0; (at = late.find("data: {\"n\":", at)) != std::string::npos; ++at) ++events;
  EXPECT_LT(events, newest - 10);
}

// Requests that begin rightly and are changed at random; the seed is fixed. The server stays, and says yes to
// nothing that it should not. SUPERTAC_BAD_REQUESTS says how many; by default it takes a second.
TEST_F(Web, MalformedRequestsAreTurnedAway) {
  const std::string right = token();
  const std::vector<std::string> seeds = {
      "GET / HTTP/1.1\r\n" + host() + "\r\n", "GET /events HTTP/1.1\r\n" + host() + "\r\n",
      "GET /files/a.safetensors HTTP/1.1\r\n" + host() + "Range: bytes=0-9\r\n\r\n",
      "POST /record HTTP/1.1\r\n" + host() + origin() + "Content-Length: 3\r\nX-Token: no\r\n\r\nabc",
      "POST /record HTTP/1.1\r\n" + host() + origin() +
          "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n"};
  std::mt19937 rng(17);  // the same numbers everywhere
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(rng() % n); };
  const char* count = std::getenv("SUPERTAC_BAD_REQUESTS");
  for (int i = 0, end = count == nullptr ? 3000 : std::atoi(count); i < end; ++i) {
    std::string request = seeds[below(seeds.size())];
    for (std::size_t changes = 1 + below(8); changes > 0; --changes) {
      const std::size_t at = below(request.size());
      const auto any = [&] { return static_cast<char>(below(256)); };
      const std::size_t kind = below(4);
      if (kind == 0) request[at] = any();
      if (kind == 1) request.erase(at, 1 + below(20));
      if (kind == 2) request.insert(at, std::string(below(i % 50 == 0 ? 40000 : 40), any()));
      if (kind == 3) request.insert(at, request.substr(below(request.size()), below(60)));
      if (request.empty()) request = "\r\n";
    }
    HttpClient client(port_);
    client.send(request);
    if (i % 100 == 0) client.receive("\r\n", 20);
  }
  EXPECT_TRUE(answers());
  EXPECT_EQ(records_, 0);
}

// What fuzzing has kept, and what hands have written: @PORT@ stands for the server's.
int corpus_port = 0;
void ask(std::span<const std::byte> bytes) {
  std::string request(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (std::size_t at = 0; (at = request.find("@PORT@", at)) != std::string::npos;)
    request.replace(at, 6, std::to_string(corpus_port));
  HttpClient client(corpus_port);
  client.send(request);
  client.receive("\r\n", 20);
}

TEST_F(Web, TheCorpusOfRequestsIsTurnedAway) {
  corpus_port = port_;
  EXPECT_GE(replay("web", ask), 190);
  EXPECT_TRUE(answers());
  EXPECT_EQ(records_, 0);
}

// Half a request, and pages that take nothing.
TEST_F(Web, AThousandSlowConnectionsLeaveRoom) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  letters_ = 8000;
  for (const std::string& words : {std::string("GET / HT"), "GET /events HTTP/1.1\r\n" + host() + "\r\n"}) {
    HttpClient owner(port_);
    ask_for_events(owner);
    owner.receive("{\"n\":");
    std::vector<std::unique_ptr<HttpClient>> slow;
    for (int i = 0; i < 1000; ++i) {
      slow.push_back(std::make_unique<HttpClient>(port_, 4096));
      slow.back()->send(words);
      if (i % 100 == 99) {
        EXPECT_TRUE(answers()) << i;
      }
    }
    const std::string later = "{\"n\":" + std::to_string(count_ + 10) + ",";
    if (words.ends_with("HT")) {
      EXPECT_TRUE(contains(owner.receive(later), later)) << "silent ones made a page leave";
    }
    EXPECT_FALSE(token().empty());
  }
}

// Twice as many as may be open at a time: each must be noticed to be gone.
TEST_F(Web, HalfRequestsThatWereClosedLeaveRoom) {
  for (std::size_t i = 0; i < 2 * WebServer::kMostPeers; ++i) HttpClient(port_).send("GET / HT");
  EXPECT_TRUE(answers());
}

// Who has read all gets it, and who reads nothing holds up nobody for longer than is said.
TEST(WebServer, TheLastThatPagesHearIsWhatBecameOfTheRun) {
  std::optional<WebServer> server;
  server.emplace(WebAddress{.port = 0},
                 WebSite{.page = live_page(),
                         .hello = [] { return std::string("{\"a\":1}"); },
                         .news = [] { return "{\"n\":\"" + std::string(20'000, 'x') + "\"}"; },
                         .actions = {}});
  const int port = std::stoi(server->url().substr(17));
  const std::string ask = "GET /events HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\n\r\n";
  HttpClient stalled(port, 4096), reader(port);
  for (HttpClient* client : {&stalled, &reader}) client->send(ask);
  reader.receive("{\"n\":");
  server->end("the plate \"a\" was\nlost", true);
  std::thread goes([&] { server.reset(); });
  const std::string last = reader.receive(
      "event: end\ndata: {\"failed\":true,\"outcome\":\"the plate \\\"a\\\" was\\nlost\"}\n\n");
  EXPECT_TRUE(contains(last, "event: end"));
  goes.join();
}

TEST(WebServer, AnAddressThatCannotBeHadIsNamed) {
  const WebSite nothing{.page = "", .hello = [] { return "{}"; }, .news = [] { return ""; }, .actions = {}};
  const WebServer first({.port = 0}, nothing);
  const int port = std::stoi(first.url().substr(17));
  const auto message = [&](const WebAddress& address) {
    return what_of<std::runtime_error>([&] { WebServer(address, nothing); });
  };
  EXPECT_EQ(message({.port = static_cast<std::uint16_t>(port)}),
            "web: '127.0.0.1' port " + std::to_string(port) +
                ": Address already in use; choose another port with --web PORT");
  EXPECT_TRUE(contains(message({.port = 0, .bind = "example.org"}), "expected a numeric address"));
}

TEST(WebView, AnEventHoldsThePictureAndWhatIsKnownOfIt) {
  LiveState state;
  state.number = 7, state.time_s = 1.5;
  state.taxels.assign(16, 0.5F), state.picture.assign(256, 1.0F);
  auto event = parse_json_limited(web_event(state, {}));
  EXPECT_EQ(event["n"], 7);
  EXPECT_EQ(event["picture"], levels_base64(state.picture));
  for (const char* unknown : {"map", "most", "wide", "distance", "unlike", "x"})
    EXPECT_FALSE(event.contains(unknown)) << unknown;
  state.half_widths.assign(256, 0.25F), state.distance = 2, state.unlike_training = true, state.x_mm = 3,
                                        state.y_mm = 4;
  state.most_changed = {.taxel = 5, .channel = 1, .rest = 40, .now = 35.5};
  event = parse_json_limited(web_event(state, {.recording = "r", .said = ""}));
  EXPECT_EQ(event["wide"], levels_base64(state.half_widths));
  EXPECT_EQ(event["unlike"], true);
  EXPECT_EQ(event["most"].dump(), R"({"channel":1,"now":35.5,"rest":40.0,"taxel":5})");
  EXPECT_EQ(event["y"], 4);
  EXPECT_EQ(event["recording"], "r");
  state.map = {.region = {-2, 5, 2, 1}, .values = {1, NAN}, .errors = {}};
  event = parse_json_limited(web_event(state, {}));
  const std::uint8_t mask[] = {1, 0};
  EXPECT_EQ(nlohmann::json(event["map"]), nlohmann::json({{"left", -2},
                                                          {"bottom", 5},
                                                          {"width", 2},
                                                          {"known", base64(mask)},
                                                          {"values", levels_base64(state.map.values)}}));
  EXPECT_FALSE(event.contains("elements"));
  // One hill of nine cells, of which the middle is highest, at the left edge of what was felt.
  state.surface = {.name = "",
                   .cells = {.region = {10, 20, 5, 5}, .values = std::vector<float>(25), .errors = {}},
                   .cell_mm = 0.75};
  for (const int cell : {5, 6, 7, 10, 11, 12, 15, 16, 17})
    state.surface->cells.values[cell] = cell == 11 ? 1 : 0.75;
  const auto told = parse_json_limited(web_event(state, {}))["elements"];
  EXPECT_EQ(told["text"], "1 element");
  ASSERT_EQ(told["rows"].size(), 1U);
  EXPECT_NEAR(told["rows"][0]["x_mm"].get<double>(), 11.5 * 0.75, 1e-6);
  EXPECT_NEAR(told["rows"][0]["y_mm"].get<double>(), 22.5 * 0.75, 1e-6);
  EXPECT_EQ(told["rows"][0]["open"], 1);
}

}  // namespace supertac::web_test
