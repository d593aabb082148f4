// With capture_server.cpp the one file that includes Boost.Beast, which takes as long to read as ten others.
#include "alidade/live/server.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <future>
#include <optional>
#include <set>
#include <thread>

#include "alidade/files/files.h"

namespace alidade::live {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr std::size_t max_clients = 8;
constexpr std::size_t max_request_bytes = 64 * 1024;  // of a client: subscriptions of all topics are 2 kB
constexpr auto tick = milliseconds(100);

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

}  // namespace

class Client;

struct Server::State {
  explicit State(ServerConfig given) : config(std::move(given)), topics(config.topics) {}

  ServerConfig config;
  TopicStore topics;
  std::size_t num_connections = 0;  // outlives what counts in it
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer timer{io};
  std::string token, session_id = random_hex(4), host_name = machine_name();
  std::uint16_t port = 0;
  std::set<std::shared_ptr<Client>> clients;
  std::atomic<std::size_t> num_clients{0};
  std::optional<std::uint64_t> newest_ns, told_ns;  ///< Times of messages: what clients take as the time now.
  int ticks_since_time = 0;
  std::thread thread;

  void listen();
  void accept();
  void on_tick();
  void for_clients(const std::function<void(Client&)>& act);
  void distribute(std::size_t index, std::int64_t t_ns, std::string payload);
  [[nodiscard]] std::size_t num_unfinished() const;
  [[nodiscard]] Response answer_to(const Request& request) const;
  [[nodiscard]] bool is_allowed(const Request& request) const;
};

/// One WebSocket. All of it runs on the server's thread.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(beast::tcp_stream&& stream, Server::State& server)
      : feed(server.topics, server.session_id), socket_(std::move(stream)), server_(server) {}

  Feed feed;  ///< After filling it: write().

  void run(Request request, const std::string& subprotocol) {
    request_ = std::move(request);
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{patience, silence, true});
    socket_.set_option(websocket::stream_base::decorator([subprotocol](websocket::response_type& response) {
      response.set(http::field::sec_websocket_protocol, subprotocol);
    }));
    socket_.read_message_max(max_request_bytes);
    socket_.async_accept(request_, [self = shared_from_this()](beast::error_code error) {
      if (error) return self->leave();
      self->is_open_ = true;
      self->write();
      self->read();
    });
  }

  void write() {
    if (!is_open_ || is_writing_) return;
    feed.note_dropped(now_s());
    if (!feed.has_next()) return;
    is_writing_ = true;
    wrote_at_s_ = now_s();
    sending_ = feed.next();
    socket_.text(sending_.is_text);
    const std::array<asio::const_buffer, 2> parts{asio::buffer(sending_.head),
                                                  sending_.body ? asio::buffer(*sending_.body) : asio::const_buffer()};
    socket_.async_write(parts, [self = shared_from_this()](beast::error_code error, std::size_t) {
      self->is_writing_ = false;
      if (error) return self->leave();
      self->write();
    });
  }

  /// Whether it is worth waiting for: not for who has stopped reading.
  [[nodiscard]] bool is_unfinished() const {
    constexpr double stuck_s = 0.5;
    if (is_writing_ && now_s() - wrote_at_s_ > stuck_s) return false;
    const bool attends_end = feed.subscribes_to(server_.topics.index_of(server_.config.end_topic));
    return is_open_ && (attends_end || is_writing_ || feed.has_next());
  }

  void close() {
    if (!std::exchange(is_open_, false)) return leave();
    socket_.async_close(websocket::close_code::going_away,
                        [self = shared_from_this()](beast::error_code) { self->leave(); });
  }
  void cut() { beast::get_lowest_layer(socket_).close(); }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      if (self->socket_.got_text()) {
        self->feed.hear(beast::buffers_to_string(self->buffer_.data()));
      } else {
        self->feed.warn("a binary message: this server is read only");
      }
      self->buffer_.consume(self->buffer_.size());
      self->write();
      self->read();
    });
  }

  void leave() {
    is_open_ = false;
    server_.clients.erase(shared_from_this());
    server_.num_clients = server_.clients.size();
  }

  websocket::stream<beast::tcp_stream> socket_;
  Server::State& server_;
  Request request_;
  beast::flat_buffer buffer_;
  Outgoing sending_;
  bool is_open_ = false, is_writing_ = false;
  double wrote_at_s_ = 0.0;
};

namespace {

/// One request and its answer; or the beginning of a WebSocket.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket&& socket, Server::State& server) : stream_(std::move(socket)), server_(server) {
    ++server_.num_connections;
    parser_.header_limit(8 * 1024);
    parser_.body_limit(1024);
  }
  ~Connection() { --server_.num_connections; }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void run() {
    stream_.expires_after(patience);
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (!error) self->handle(self->parser_.release());
    });
  }

 private:
  void handle(Request request) {
    if (!websocket::is_upgrade(request) || server_.topics.size() == 0 || !server_.is_allowed(request))
      return send(server_.answer_to(request));
    const auto offered = request[http::field::sec_websocket_protocol];
    const auto subprotocol = chosen_subprotocol({offered.data(), offered.size()});
    if (!subprotocol)
      return refuse(http::status::bad_request, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1\n");
    if (server_.clients.size() >= max_clients)
      return refuse(http::status::service_unavailable, fmt::format("{} clients are served, no more\n", max_clients));
    const auto client = std::make_shared<Client>(std::move(stream_), server_);
    server_.clients.insert(client);
    server_.num_clients = server_.clients.size();
    client->run(std::move(request), *subprotocol);
  }

  void refuse(http::status status, const std::string& what) {
    Response response{status, 11};
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = what;
    send(std::move(response));
  }

  void send(Response response) {
    response_ = std::move(response);
    response_.keep_alive(false);
    response_.prepare_payload();
    stream_.expires_after(patience);
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code, std::size_t) {
      beast::error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  beast::tcp_stream stream_;
  Server::State& server_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  Response response_;
};

}  // namespace

void Server::State::listen() {
  beast::error_code error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) throw InputError("--live-address: '" + config.address + "' is not a numeric address");
  if (!address.is_loopback()) token = random_hex(4);
  const tcp::endpoint endpoint(address, config.port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error == asio::error::address_in_use)
    throw InputError(fmt::format("port {} of {} is in use; give another one, or 0 for any that is free", config.port,
                                 config.address));
  if (error) throw InputError(fmt::format("port {} of {}: {}", config.port, config.address, error.message()));
  port = acceptor.local_endpoint().port();
}

void Server::State::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && num_connections < max_connections) {
      socket.set_option(tcp::no_delay(true), error);
      std::make_shared<Connection>(std::move(socket), *this)->run();
    }
    accept();
  });
}

/// The time of the newest message, and once a second in any case: who hears nothing knows that the run is gone.
void Server::State::on_tick() {
  timer.expires_after(tick);
  timer.async_wait([this](beast::error_code error) {
    if (!error) on_tick();
  });
  if (!newest_ns || (newest_ns == told_ns && ++ticks_since_time < 10)) return;
  told_ns = newest_ns;
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

std::size_t Server::State::num_unfinished() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(clients, [](const auto& client) { return client->is_unfinished(); }));
}

bool Server::State::is_allowed(const Request& request) const {
  const auto host = request[http::field::host];
  const auto target = request.target();
  return is_own_host({host.data(), host.size()}, config.address, port, host_name) &&
         (token.empty() || has_token({target.data(), target.size()}, token));
}

Response Server::State::answer_to(const Request& request) const {
  HttpAnswer answer{403, "text/plain; charset=utf-8", "forbidden: another name than this server's, or no token\n"};
  const bool is_head = request.method() == http::verb::head;
  if (is_allowed(request)) {
    const auto target = request.target();
    answer = is_head || request.method() == http::verb::get
                 ? config.get(path_of({target.data(), target.size()}))
                 : HttpAnswer{405, "text/plain; charset=utf-8", "read only\n"};
  }
  Response response{static_cast<http::status>(answer.status), request.version()};
  response.set(http::field::content_type, answer.type);
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");  // the token is nobody else's
  response.set("X-Frame-Options", "DENY");
  if (!is_head) response.body() = std::move(answer.body);
  return response;
}

Server::Server(ServerConfig config) : state_(std::make_unique<State>(std::move(config))) {
  State& state = *state_;
  state.listen();
  state.accept();
  state.on_tick();
  state.thread = std::thread([&state] { state.io.run(); });
}

Server::~Server() {
  State& state = *state_;
  asio::post(state.io, [&state] {
    beast::error_code ignored;
    state.acceptor.close(ignored);
    for (const auto& client : std::set(state.clients)) client->close();
  });
  for (int i = 0; i < 60 && state.num_clients > 0; ++i) std::this_thread::sleep_for(milliseconds(5));
  state.io.stop();
  state.thread.join();
  for (const auto& client : std::set(state.clients)) client->cut();
}

std::string Server::url() const {
  std::string address = state_->config.address;
  if (address == "0.0.0.0" || address == "::") address = state_->host_name.empty() ? "localhost" : state_->host_name;
  if (address.find(':') != std::string::npos) address = "[" + address + "]";
  return fmt::format("http://{}:{}/{}{}", address, state_->port, state_->token.empty() ? "" : "?token=", state_->token);
}

std::uint16_t Server::port() const { return state_->port; }

bool Server::send(std::string_view topic, std::int64_t t_ns, std::function<std::string()> make, std::size_t lane,
                  bool is_last) {
  State& state = *state_;
  const std::size_t index = state.topics.index_of(topic);
  if (index == TopicStore::none || (!state.topics.lets_through(index, lane, now_s()) && !is_last)) return false;
  asio::post(state.io, [&state, index, t_ns, make = std::move(make)] { state.distribute(index, t_ns, make()); });
  return true;
}

void Server::tell(StatusLevel level, std::string message) {
  asio::post(state_->io, [&state = *state_, level, message = std::move(message)] {
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
    asio::post(state_->io, [&] { counted.set_value(state_->num_unfinished()); });
    return counted.get_future().get();
  };
  while (count() > 0 && Clock::now() < until) std::this_thread::sleep_for(milliseconds(5));
}

}  // namespace alidade::live
