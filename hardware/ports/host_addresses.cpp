#include "hardware/ports/host_addresses.h"

#include <sys/socket.h>

#include "hardware/ports/errors.h"

namespace supertac {
namespace {

// What a thread of the C library reads and writes while it asks.
struct Question {
  std::string host, service;
  addrinfo wanted{};
  gaicb entry{};
};

}  // namespace

HostAddresses host_addresses(const std::string& what, const std::string& host, int port, int type) {
  auto question = std::make_unique<Question>();
  question->host = host, question->service = std::to_string(port);
  question->wanted.ai_socktype = type;
  question->wanted.ai_family = host.empty() ? AF_INET : AF_UNSPEC;
  question->wanted.ai_flags = host.empty() ? AI_PASSIVE : 0;
  gaicb& entry = question->entry;
  entry.ar_name = host.empty() ? nullptr : question->host.c_str();
  entry.ar_service = question->service.c_str(), entry.ar_request = &question->wanted;
  gaicb* entries[] = {&entry};
  int error = getaddrinfo_a(GAI_NOWAIT, entries, 1, nullptr);
  if (error == 0) {
    const timespec patience{kPatienceS, 0};
    (void)gai_suspend(entries, 1, &patience);
    error = gai_error(&entry);
  }
  if (error == EAI_INPROGRESS) {
    // Who cannot be stopped goes on writing there.
    if (gai_cancel(&entry) == EAI_NOTCANCELED) (void)question.release();
    throw PortError(what +
                    ": the name server does not answer; see whether the host is right, or give its number");
  }
  HostAddresses found(entry.ar_result);
  if (error != 0) throw PortError(what + ": " + gai_strerror(error) + "; see whether the host is right");
  return found;
}

}  // namespace supertac
