#include "alidade/live/server.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <optional>
#include <set>
#include <thread>

namespace alidade::live {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t max_clients = 8;
constexpr std::size_t max_request_bytes = 64 * 1024;  // of a client: subscriptions of all topics are 2 kB
constexpr auto tick = milliseconds(100);

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

}  // namespace

class Client;

struct Server::State : WebSite {
  explicit State(ServerConfig given)
      : config(std::move(given)), topics(config.topics), host({config.address, config.port, max_request_bytes}, *this) {
    if (!host.is_loopback()) token = random_hex(4);
    host.repeat(tick, [this] { on_tick(); });
    host.start();
  }

  ServerConfig config;
  TopicStore topics;
  std::string token, session_id = random_hex(4);
  std::set<std::shared_ptr<Client>> clients;
  std::atomic<std::size_t> num_clients{0};
  std::optional<std::uint64_t> newest_ns, given_ns;  ///< Times of messages: what clients take as the time now.
  int ticks_since_time = 0;
  WebHost host;  // last: its thread uses the others

  void on_tick();
  void for_clients(const std::function<void(Client&)>& act);
  void distribute(std::size_t index, std::int64_t t_ns, std::string payload);
  void leave(Client& client);
  [[nodiscard]] std::size_t num_unfinished() const;
  [[nodiscard]] std::string refusal(const WebRequest& request) const override;
  [[nodiscard]] HttpAnswer get(std::string_view path) const override { return config.get(path); }
  [[nodiscard]] Socket socket(const WebRequest& request) override;
};

/// One WebSocket. All of it runs on the server's thread.
class Client : public SocketUser, public std::enable_shared_from_this<Client> {
 public:
  explicit Client(Server::State& server) : feed(server.topics, server.session_id), server_(server) {}

  Feed feed;  ///< After filling it: write().

  void opened() override {}
  bool hear(std::string_view message, bool is_text) override {
    if (is_text) {
      feed.hear(message);
    } else {
      feed.warn("a binary message: this server is read only");
    }
    return true;
  }
  [[nodiscard]] bool has_next() override {
    feed.note_dropped(now_s());
    return feed.has_next();
  }
  [[nodiscard]] Outgoing next() override { return feed.next(); }
  void left() override { server_.leave(*this); }

  void write() {
    if (socket != nullptr) socket->write();
  }

  /// Whether it is worth waiting for: not for who has stopped reading.
  [[nodiscard]] bool is_unfinished() const {
    constexpr double stuck_s = 0.5;
    if (socket == nullptr || !socket->is_open() || socket->writing_s() > stuck_s) return false;
    const bool attends_end = feed.subscribes_to(server_.topics.index_of(server_.config.end_topic));
    return attends_end || socket->writing_s() > 0.0 || feed.has_next();
  }

 private:
  Server::State& server_;
};

/// The time of the newest message, and once a second in any case: who hears nothing knows that the run is gone.
void Server::State::on_tick() {
  if (!newest_ns || (newest_ns == given_ns && ++ticks_since_time < 10)) return;
  given_ns = newest_ns;
  ticks_since_time = 0;
  for_clients([&](Client& client) { client.feed.tell_time(*newest_ns); });
}

void Server::State::for_clients(const std::function<void(Client&)>& act) {
  for (const auto& client : std::set(clients)) {  // a copy: who writes may leave
    act(*client);
    client->write();
  }
}

void Server::State::distribute(std::size_t index, std::int64_t t_ns, std::string payload) {
  const KeptMessage message{static_cast<std::uint64_t>(std::max<std::int64_t>(0, t_ns)), now_s(),
                            std::make_shared<const std::string>(std::move(payload))};
  newest_ns = std::max(newest_ns.value_or(0), message.t_ns);  // what has no time of its own comes as 0
  topics.keep(index, message);
  for_clients([&](Client& client) { client.feed.offer(index, message); });
}

void Server::State::leave(Client& client) {
  client.socket = nullptr;
  clients.erase(client.shared_from_this());
  num_clients = clients.size();
}

std::size_t Server::State::num_unfinished() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(clients, [](const auto& client) { return client->is_unfinished(); }));
}

std::string Server::State::refusal(const WebRequest& request) const {
  const bool is_allowed = host.is_own(request.host) && (token.empty() || has_token(request.target, token));
  return is_allowed ? "" : "forbidden: another name than this server's, or no token\n";
}

WebSite::Socket Server::State::socket(const WebRequest& request) {
  if (topics.size() == 0) return {};
  const auto refused = [](int status, std::string what) {
    return Socket{nullptr, "", HttpAnswer{status, "text/plain; charset=utf-8", std::move(what)}};
  };
  const auto subprotocol = chosen_subprotocol(request.subprotocols);
  if (!subprotocol) return refused(400, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1\n");
  if (clients.size() >= max_clients) return refused(503, fmt::format("{} clients are served, no more\n", max_clients));
  const auto client = std::make_shared<Client>(*this);
  clients.insert(client);
  num_clients = clients.size();
  return {client, *subprotocol, std::nullopt};
}

Server::Server(ServerConfig config) : state_(std::make_unique<State>(std::move(config))) {}

Server::~Server() = default;

std::string Server::url() const { return state_->host.url(state_->token); }

std::uint16_t Server::port() const { return state_->host.port(); }

bool Server::send(std::string_view topic, std::int64_t t_ns, std::function<std::string()> make, std::size_t lane,
                  bool is_last) {
  State& state = *state_;
  const std::size_t index = state.topics.index_of(topic);
  if (index == TopicStore::none || (!state.topics.lets_through(index, lane, now_s()) && !is_last)) return false;
  state.host.post([&state, index, t_ns, make = std::move(make)] { state.distribute(index, t_ns, make()); });
  return true;
}

void Server::tell(StatusLevel level, std::string message) {
  state_->host.post([&state = *state_, level, message = std::move(message)] {
    state.for_clients([&](Client& client) { client.feed.tell(level, message); });
  });
}

std::vector<std::string> Server::kept(std::string_view topic) const {
  std::vector<std::string> bodies;
  const std::size_t index = state_->topics.index_of(topic);
  if (index == TopicStore::none) return bodies;
  for (const KeptMessage& message : state_->topics.kept(index)) bodies.push_back(*message.body);
  return bodies;
}

std::size_t Server::num_clients() const { return state_->num_clients; }

void Server::finish(double max_s) {
  const auto until = Clock::now() + std::chrono::duration<double>(max_s);
  const auto count = [this] {
    std::promise<std::size_t> counted;
    state_->host.post([&] { counted.set_value(state_->num_unfinished()); });
    return counted.get_future().get();
  };
  while (count() > 0 && Clock::now() < until) std::this_thread::sleep_for(milliseconds(5));
}

}  // namespace alidade::live
