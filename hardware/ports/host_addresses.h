// Addresses of a host by its name, within a bounded time.
#pragma once

#include <netdb.h>

#include <memory>
#include <string>

namespace supertac {

struct FreeAddresses {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};
using HostAddresses = std::unique_ptr<addrinfo, FreeAddresses>;

constexpr int kPatienceS = 5;  ///< with a name server, and with a host that does not answer

/// Of `host` (empty: of this computer, to listen at) and `port`, for sockets of `type` (SOCK_DGRAM,
/// SOCK_STREAM). getaddrinfo() alone may wait for name servers for minutes; here at most kPatienceS, and less
/// when a signal comes. Throws PortError, "`what`: <why>".
HostAddresses host_addresses(const std::string& what, const std::string& host, int port, int type);

}  // namespace supertac
