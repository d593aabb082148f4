#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "alidade/live/send_queue.h"

namespace alidade::live {

struct HttpAnswer {
  int status = 404;
  std::string type = "text/plain; charset=utf-8";
  std::string body = "not found\n";
};

/// A request, as far as a site judges it.
struct WebRequest {
  std::string method, target, host;
  std::optional<std::string> origin = {};  ///< Of browsers.
  bool wants_socket = false;
  std::string subprotocols = {};  ///< That it offers for a socket.
};

/// A WebSocket, as its user sees it. All on the host's thread.
class WebSocket {
 public:
  virtual ~WebSocket() = default;
  /// Sends what its user has next, one after the other.
  virtual void write() = 0;
  virtual void close() = 0;
  [[nodiscard]] virtual bool is_open() const = 0;
  /// How long the message that is on its way has been so [s]; 0: none is.
  [[nodiscard]] virtual double writing_s() const = 0;
};

/// Who talks through a WebSocket. All on the host's thread.
class SocketUser {
 public:
  virtual ~SocketUser() = default;
  virtual void opened() = 0;
  /// False: it is not to be talked to, and is closed.
  virtual bool hear(std::string_view message, bool is_text) = 0;
  [[nodiscard]] virtual bool has_next() = 0;
  [[nodiscard]] virtual Outgoing next() = 0;
  virtual void left() = 0;
  WebSocket* socket = nullptr;  ///< The host's; from before opened() to left().
};

/// What a host serves. All on its thread.
class WebSite {
 public:
  virtual ~WebSite() = default;
  /// Why the request is refused (403); empty: it is not.
  [[nodiscard]] virtual std::string refusal(const WebRequest& request) const = 0;
  [[nodiscard]] virtual HttpAnswer get(std::string_view path) const = 0;
  /// A socket that is granted: who uses it, or what is answered instead. Neither: it is answered as any other request.
  struct Socket {
    std::shared_ptr<SocketUser> user;
    std::string subprotocol;
    std::optional<HttpAnswer> instead;
  };
  [[nodiscard]] virtual Socket socket(const WebRequest& request) = 0;
};

struct WebHostConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;                     ///< 0: any free one.
  std::size_t max_message_bytes = 64 * 1024;  ///< Of a socket.
};

/// HTTP and WebSockets on one port, by one thread of its own: requests with their limits of size and time, answers with
/// the headers that keep a page to itself. The one file that includes Boost.Beast.
class WebHost {
 public:
  /// Takes the port. Throws InputError where that cannot be: it is in use, or the address is not this machine's.
  WebHost(WebHostConfig config, WebSite& site);
  /// Closes all connections.
  ~WebHost();
  WebHost(const WebHost&) = delete;
  WebHost& operator=(const WebHost&) = delete;

  /// Begins to answer.
  void start();
  /// Does it on its thread.
  void post(std::function<void()> work);
  /// Does it every so often on its thread. Before start().
  void repeat(std::chrono::milliseconds every, std::function<void()> work);

  [[nodiscard]] std::uint16_t port() const;
  /// The address is one of the machine's own that no other machine reaches.
  [[nodiscard]] bool is_loopback() const;
  /// Whether a Host header means this server.
  [[nodiscard]] bool is_own(std::string_view host) const;
  /// "http://127.0.0.1:8765/", with the token where there is one.
  [[nodiscard]] std::string url(const std::string& token) const;
  [[nodiscard]] const std::string& machine_name() const;

  struct State;

 private:
  std::unique_ptr<State> state_;
};

/// So many times 32 random bits, as hexadecimal digits.
[[nodiscard]] std::string random_hex(int num_words);

}  // namespace alidade::live
