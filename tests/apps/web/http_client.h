// A client for tests that sends what it is told, right or wrong.
#pragma once

#include <fcntl.h>
#include <poll.h>

#include <cerrno>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "io/files/json.h"
#include "tests/support/sockets.h"

namespace supertac {

class HttpClient {
 public:
  /// Connects to 127.0.0.1. `receive_buffer`: bytes that the kernel may hold for it; 0: its own choice.
  explicit HttpClient(int port, int receive_buffer = 0)
      : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    // Out of the way of a server in this process, which cannot have descriptors above FD_SETSIZE: a client is
    // another program elsewhere.
    if (const int high = fcntl(socket_, F_DUPFD_CLOEXEC, FD_SETSIZE); high >= 0) {
      close(socket_);
      socket_ = high;
    }
    if (receive_buffer > 0)
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    const sockaddr_in place = at_port(port);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0)
      throw std::runtime_error("cannot connect to port " + std::to_string(port));
  }
  ~HttpClient() { close(socket_); }
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;

  void send(std::string_view bytes) { (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// What has come so far, once it holds `part` or nothing more comes for `wait_ms`.
  std::string receive(std::string_view part, int wait_ms = 60'000) {
    char buffer[4096];
    pollfd ready{socket_, POLLIN, 0};
    while (got_.find(part) == std::string::npos && poll(&ready, 1, wait_ms) > 0) {
      const ssize_t count = recv(socket_, buffer, sizeof buffer, 0);
      if (count <= 0) break;
      got_.append(buffer, static_cast<std::size_t>(count));
    }
    return got_;
  }

 private:
  int socket_;
  std::string got_;
};

/// Status of one request on a connection of its own; 0 when it was closed without an answer.
inline int status_of(int port, const std::string& request) {
  HttpClient client(port);
  client.send(request);
  const std::string answer = client.receive("\r\n");
  return answer.starts_with("HTTP/1.") ? std::stoi(answer.substr(9, 3)) : 0;
}

/// The data of the event that begins with `mark`.
inline nlohmann::ordered_json event_after(const std::string& text, const std::string& mark) {
  const std::size_t begin = text.find(mark) + mark.size();
  return parse_json_limited(text.substr(begin, text.find("\n\n", begin) - begin));
}

/// Connects to a server that may only just be starting.
inline std::unique_ptr<HttpClient> connect_when_up(int port) {
  for (int i = 0; i < 2400; ++i, usleep(50'000)) {
    try {
      return std::make_unique<HttpClient>(port);
    } catch (const std::runtime_error&) {  // not yet
    }
  }
  return nullptr;
}

}  // namespace supertac
