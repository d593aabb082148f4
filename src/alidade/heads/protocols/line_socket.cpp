#include "alidade/heads/protocols/line_socket.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>

#include "alidade/files/files.h"

namespace alidade {
namespace {

double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Until the socket can do that, or the time is up: false.
bool is_ready(int socket, short what, double until_s) {
  for (;;) {
    const double left = until_s - steady_s();
    pollfd waiting{socket, what, 0};
    const int got = ::poll(&waiting, 1, left > 0.0 ? std::max(1, static_cast<int>(left * 1e3)) : 0);
    if (got > 0) return true;
    if ((got < 0 && errno != EINTR) || left <= 0.0) return false;
  }
}

int connected(const addrinfo& endpoint, double until_s) {
  const int socket =
      ::socket(endpoint.ai_family, endpoint.ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, endpoint.ai_protocol);
  if (socket < 0) return -1;
  int error = ::connect(socket, endpoint.ai_addr, endpoint.ai_addrlen) == 0 ? 0 : errno;
  if (error == EINPROGRESS && is_ready(socket, POLLOUT, until_s)) {
    socklen_t size = sizeof error;
    ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size);
  }
  if (error == 0) return socket;
  ::close(socket);
  return -1;
}

}  // namespace

SocketAddress address_of(const std::string& url, std::string_view scheme, std::uint16_t usual_port) {
  SocketAddress address{.name = url, .user = "", .host = "", .port = usual_port};
  std::string rest = url.substr(std::min(url.size(), scheme.size()));
  if (const std::size_t at = rest.find('@'); at != std::string::npos) {
    address.user = rest.substr(0, at);
    rest = rest.substr(at + 1);
    if (address.user.empty() || address.user.find_first_of(":/?") != std::string::npos ||
        rest.find('@') != std::string::npos)
      throw InputError(
          fmt::format("{}…: no password may be in an address, where others can read it; give {}USER@HOST, and the "
                      "password by --password-file or in ALIDADE_PASSWORD",
                      scheme, scheme));
  }
  rest = rest.substr(0, rest.find_first_of("/?"));
  const std::size_t bracket = rest.find(']');
  const std::size_t colon = rest.find(':', bracket == std::string::npos ? 0 : bracket);
  address.host = rest.substr(0, colon);
  if (address.host.starts_with('[') && address.host.ends_with(']'))
    address.host = address.host.substr(1, address.host.size() - 2);
  int port = usual_port;
  if (colon != std::string::npos) {
    const std::string digits = rest.substr(colon + 1);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
    if (error != std::errc() || end != digits.data() + digits.size()) port = -1;
  }
  if (address.host.empty() || port < 1 || port > 65535)
    throw InputError(
        fmt::format("'{}' is no address: {}HOST:PORT, for example {}127.0.0.1:{}", url, scheme, scheme, usual_port));
  address.port = static_cast<std::uint16_t>(port);
  return address;
}

std::string without_password(const std::string& url) {
  const std::size_t scheme = url.find("://"), begin = scheme == std::string::npos ? 0 : scheme + 3;
  const std::size_t at = url.find('@', begin);
  if (at != std::string::npos && url.find(':', begin) < at) return url.substr(0, begin) + "…";
  return url;
}

void LineSocket::begin_exchange(double max_s) { exchange_until_s_ = steady_s() + max_s; }

double LineSocket::until_s() const {
  return std::min(steady_s() + timeout_s_, exchange_until_s_.value_or(std::numeric_limits<double>::infinity()));
}

void LineSocket::fail(const std::string& what) {
  close();
  throw InputError(address_.name + ": " + what);
}

void LineSocket::connect() {
  if (socket_ >= 0) return;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(address_.host.c_str(), std::to_string(address_.port).c_str(), &hints, &found);
  if (error != 0) fail(std::string("no such host: ") + ::gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> endpoints(found, &::freeaddrinfo);
  const double until_s = this->until_s();
  for (const addrinfo* endpoint = found; endpoint != nullptr && socket_ < 0; endpoint = endpoint->ai_next)
    socket_ = connected(*endpoint, until_s);
  if (socket_ < 0) fail("no answer from that address");
  const int on = 1;
  ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  if (trust_) begin_tls(until_s);
}

void LineSocket::begin_tls(double until_s) {
  std::string fault;
  const auto wait = [&](bool to_write) { return is_ready(socket_, to_write ? POLLOUT : POLLIN, until_s); };
  tls_ = TlsSession::begin(socket_, *trust_, wait, fault);
  if (!tls_) fail(fault);
}

ssize_t LineSocket::receive(char* bytes, std::size_t count) {
  return tls_ ? tls_->read(bytes, count) : ::recv(socket_, bytes, count, 0);
}

bool LineSocket::can_receive(double until_s) const {
  return (tls_ && tls_->has_waiting()) || is_ready(socket_, POLLIN, until_s);
}

void LineSocket::close() {
  tls_.reset();
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  buffer_.clear();
}

void LineSocket::write(std::string_view text) {
  if (socket_ < 0) fail("not connected");
  const double until_s = this->until_s();
  while (!text.empty()) {
    if (steady_s() > until_s || !is_ready(socket_, POLLOUT, until_s)) fail("takes nothing");
    const ssize_t sent =
        tls_ ? tls_->write(text.data(), text.size()) : ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    if (sent < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (sent <= 0) fail("has closed the connection");
    text.remove_prefix(static_cast<std::size_t>(sent));
  }
}

void LineSocket::fill(double until_s) {
  constexpr std::size_t most = 1 << 24;  // of what nobody asked for
  if (socket_ < 0) fail("not connected");
  if (buffer_.size() > most) fail("sends what has no end");
  if (steady_s() > until_s || !can_receive(until_s)) fail(fmt::format("no answer within {:g} s", timeout_s_));
  char chunk[65536];
  const ssize_t got = receive(chunk, sizeof chunk);
  if (got < 0 && (errno == EINTR || errno == EAGAIN)) return;
  if (got <= 0) fail("has closed the connection");
  buffer_.append(chunk, static_cast<std::size_t>(got));
}

std::string LineSocket::line() {
  const double until_s = this->until_s();
  std::size_t end = 0;
  while ((end = buffer_.find('\n')) == std::string::npos) fill(until_s);
  std::string line = buffer_.substr(0, end);
  buffer_.erase(0, end + 1);
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
  return line;
}

std::string LineSocket::bytes(std::size_t count) {
  const double until_s = this->until_s();
  while (buffer_.size() < count) fill(until_s);
  std::string taken = buffer_.substr(0, count);
  buffer_.erase(0, count);
  return taken;
}

std::string LineSocket::some(double wait_s) {
  if (socket_ < 0) fail("not connected");
  if (buffer_.empty() && can_receive(steady_s() + wait_s)) fill(until_s());
  return std::exchange(buffer_, {});
}

std::string LineSocket::rest() {
  constexpr std::size_t most = 1 << 24;
  const double until_s = this->until_s();
  while (buffer_.size() < most) {
    if (steady_s() > until_s || !can_receive(until_s)) fail(fmt::format("no answer within {:g} s", timeout_s_));
    char chunk[65536];
    const ssize_t got = receive(chunk, sizeof chunk);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (got <= 0) break;
    buffer_.append(chunk, static_cast<std::size_t>(got));
  }
  std::string taken = std::exchange(buffer_, {});
  close();
  return taken;
}

}  // namespace alidade
