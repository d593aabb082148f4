#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/live/topic_store.h"
#include "alidade/live/web_host.h"

namespace alidade::live {

struct ServerConfig {
  std::string address = "127.0.0.1";  ///< Another than the machine's own needs a token, which url() shows.
  std::uint16_t port = 8765;          ///< 0: any free one.
  std::vector<Topic> topics;          ///< None: no WebSocket.
  std::string end_topic;              ///< Who subscribes to it is waited for at the end, until it leaves.
  std::function<HttpAnswer(std::string_view path)> get;  ///< Called by the server's thread.
};

/// Pages over HTTP and messages over WebSocket in the Foxglove protocol, on one port, by one thread of its own. At most
/// 8 clients; read only; whoever calls never waits: a client has a queue of 4 MB, of which the oldest is dropped.
class Server {
 public:
  /// Listens. Throws InputError where that cannot be: the port is in use, or the address is not this machine's.
  explicit Server(ServerConfig config);
  /// Closes all connections.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// "http://127.0.0.1:8765/", with the token where there is one.
  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::uint16_t port() const;

  /// A message with its time, which `make` writes on the server's thread. Skipped, and `make` not called, where its
  /// topic has had its share of this second; `is_last` goes always. False: dropped. From any thread.
  bool send(std::string_view topic, std::int64_t t_ns, std::function<std::string()> make, std::size_t lane = 0,
            bool is_last = false);
  /// A line for every client.
  void tell(StatusLevel level, std::string message);
  /// The messages of a topic that are kept. Only from `get`.
  [[nodiscard]] std::vector<std::string> kept(std::string_view topic) const;

  [[nodiscard]] std::size_t num_clients() const;
  /// Waits until all that was sent is out and those who attend the end have left; not longer than so many seconds.
  void finish(double max_s);

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace alidade::live
