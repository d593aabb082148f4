#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "alidade/heads/protocols/tls.h"

namespace alidade {

struct SocketAddress {
  std::string name;  ///< To begin a message with; no password.
  std::string user;  ///< "scheme://USER@HOST"; empty: none.
  std::string host;
  std::uint16_t port = 0;
};

/// Host and port of "scheme://[USER@]HOST:PORT[/…]"; [::1] for addresses with colons. Throws InputError; so does a
/// password in it, which is not repeated.
[[nodiscard]] SocketAddress address_of(const std::string& url, std::string_view scheme, std::uint16_t usual_port);

/// An address as it may be shown: "scheme://…" alone where it has anything like a password in it.
[[nodiscard]] std::string without_password(const std::string& url);

/// A TCP connection whose every call ends within its timeout. After a failure it is closed: an answer that comes late
/// is not taken for the next one's. Throws InputError.
class LineSocket {
 public:
  LineSocket(SocketAddress address, double timeout_s) : address_(std::move(address)), timeout_s_(timeout_s) {}
  ~LineSocket() { close(); }
  LineSocket(const LineSocket&) = delete;
  LineSocket& operator=(const LineSocket&) = delete;

  /// From the next connection on it is encrypted, for who is believed by that.
  void encrypt(TlsTrust trust) { trust_ = std::move(trust); }
  /// Where it is not connected.
  void connect();
  void close();
  [[nodiscard]] bool is_connected() const { return socket_ >= 0; }
  void write(std::string_view text);
  /// The next line, without its end.
  [[nodiscard]] std::string line();
  /// So many bytes.
  [[nodiscard]] std::string bytes(std::size_t count);
  /// What has come, at least a byte of it; empty where nothing comes within so many seconds.
  [[nodiscard]] std::string some(double wait_s);
  /// All until the other side closes.
  [[nodiscard]] std::string rest();
  void set_timeout(double timeout_s) { timeout_s_ = timeout_s; }
  /// From now on all calls together end within so many seconds, until it is called again: who answers a letter at a
  /// time is not waited for.
  void begin_exchange(double max_s);
  [[nodiscard]] const SocketAddress& address() const { return address_; }

 private:
  [[nodiscard]] double until_s() const;
  void fill(double until_s);
  void begin_tls(double until_s);
  [[nodiscard]] ssize_t receive(char* bytes, std::size_t count);
  /// Until something can be received, or the time is up: false.
  [[nodiscard]] bool can_receive(double until_s) const;
  [[noreturn]] void fail(const std::string& what);

  SocketAddress address_;
  double timeout_s_;
  std::optional<double> exchange_until_s_;
  int socket_ = -1;
  std::optional<TlsTrust> trust_;
  std::unique_ptr<TlsSession> tls_;
  std::string buffer_;
};

}  // namespace alidade
