// The one file that includes Boost.Beast: it takes as long to compile as ten others.
#include "alidade/live/web_host.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <random>
#include <set>
#include <thread>
#include <utility>

#include "alidade/files/files.h"
#include "alidade/live/protocol.h"

namespace alidade::live {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr std::size_t max_connections = 40;
constexpr auto patience = std::chrono::seconds(10);  // with a request that does not come
constexpr auto silence = std::chrono::seconds(40);   // of a socket that answers no ping

std::string name_of_machine() {
  char name[256] = {};
  return ::gethostname(name, sizeof name - 1) == 0 ? name : "";
}

WebRequest web_request(const Request& request) {
  const auto text = [&request](http::field field) { return std::string(request[field]); };
  WebRequest made{std::string(request.method_string()), std::string(request.target()), text(http::field::host)};
  if (request.find(http::field::origin) != request.end()) made.origin = text(http::field::origin);
  made.wants_socket = websocket::is_upgrade(request);
  made.subprotocols = text(http::field::sec_websocket_protocol);
  return made;
}

}  // namespace

class BeastSocket;

struct WebHost::State {
  State(WebHostConfig given, WebSite& of_site) : config(std::move(given)), site(of_site) {}

  WebHostConfig config;
  WebSite& site;
  std::size_t num_connections = 0;  // outlives what counts in it
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer timer{io};
  std::chrono::milliseconds every{0};
  std::function<void()> repeated;
  std::string host_name = name_of_machine();
  std::uint16_t port = 0;
  std::set<std::shared_ptr<BeastSocket>> sockets;
  std::atomic<std::size_t> num_sockets{0};
  std::thread thread;

  void listen();
  void accept();
  void tick();
  [[nodiscard]] Response answer_to(const WebRequest& request) const;
  [[nodiscard]] Response response_of(HttpAnswer answer, bool is_head) const;
};

/// All of it runs on the host's thread.
class BeastSocket : public WebSocket, public std::enable_shared_from_this<BeastSocket> {
 public:
  BeastSocket(beast::tcp_stream&& stream, WebHost::State& host, std::shared_ptr<SocketUser> user)
      : socket_(std::move(stream)), host_(host), user_(std::move(user)) {
    user_->socket = this;
  }

  void run(Request request, const std::string& subprotocol) {
    request_ = std::move(request);
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{patience, silence, true});
    if (!subprotocol.empty()) {
      socket_.set_option(websocket::stream_base::decorator([subprotocol](websocket::response_type& response) {
        response.set(http::field::sec_websocket_protocol, subprotocol);
      }));
    }
    socket_.read_message_max(host_.config.max_message_bytes);
    socket_.async_accept(request_, [self = shared_from_this()](beast::error_code error) {
      if (error) return self->leave();
      self->is_open_ = true;
      self->user_->opened();
      self->write();
      self->read();
    });
  }

  void write() override {
    if (!is_open_ || is_writing_ || !user_->has_next()) return;
    is_writing_ = true;
    wrote_at_ = Clock::now();
    sending_ = user_->next();
    socket_.text(sending_.is_text);
    const std::array<asio::const_buffer, 2> parts{asio::buffer(sending_.head),
                                                  sending_.body ? asio::buffer(*sending_.body) : asio::const_buffer()};
    socket_.async_write(parts, [self = shared_from_this()](beast::error_code error, std::size_t) {
      self->is_writing_ = false;
      if (error) return self->leave();
      self->write();
    });
  }
  void close() override { close_as(websocket::close_code::going_away); }
  [[nodiscard]] bool is_open() const override { return is_open_; }
  [[nodiscard]] double writing_s() const override {
    return is_writing_ ? std::max(1e-9, std::chrono::duration<double>(Clock::now() - wrote_at_).count()) : 0.0;
  }
  void cut() { beast::get_lowest_layer(socket_).close(); }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      const std::string_view data(static_cast<const char*>(self->buffer_.cdata().data()), self->buffer_.size());
      if (!self->user_->hear(data, self->socket_.got_text()))
        return self->close_as(websocket::close_code::policy_error);
      self->buffer_.consume(self->buffer_.size());
      self->write();
      self->read();
    });
  }
  void close_as(websocket::close_code code) {
    if (!std::exchange(is_open_, false)) return leave();
    socket_.async_close(code, [self = shared_from_this()](beast::error_code) { self->leave(); });
  }
  void leave() {
    is_open_ = false;
    if (host_.sockets.erase(shared_from_this()) == 0) return;
    host_.num_sockets = host_.sockets.size();
    user_->left();
  }

  websocket::stream<beast::tcp_stream> socket_;
  WebHost::State& host_;
  std::shared_ptr<SocketUser> user_;
  Request request_;
  beast::flat_buffer buffer_;
  Outgoing sending_;
  bool is_open_ = false, is_writing_ = false;
  Clock::time_point wrote_at_{};
};

namespace {

/// One request and its answer; or the beginning of a WebSocket.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket&& socket, WebHost::State& host) : stream_(std::move(socket)), host_(host) {
    ++host_.num_connections;
    parser_.header_limit(8 * 1024);
    parser_.body_limit(1024);
  }
  ~Connection() { --host_.num_connections; }
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
    const WebRequest asked = web_request(request);
    if (!asked.wants_socket || !host_.site.refusal(asked).empty()) return send(host_.answer_to(asked));
    WebSite::Socket granted = host_.site.socket(asked);
    if (granted.instead) return send(host_.response_of(std::move(*granted.instead), false));
    if (!granted.user) return send(host_.answer_to(asked));
    const auto socket = std::make_shared<BeastSocket>(std::move(stream_), host_, std::move(granted.user));
    host_.sockets.insert(socket);
    host_.num_sockets = host_.sockets.size();
    socket->run(std::move(request), granted.subprotocol);
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
  WebHost::State& host_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  Response response_;
};

}  // namespace

void WebHost::State::listen() {
  beast::error_code error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) throw InputError("--live-address: '" + config.address + "' is not a numeric address");
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

void WebHost::State::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && num_connections < max_connections) {
      socket.set_option(tcp::no_delay(true), error);
      std::make_shared<Connection>(std::move(socket), *this)->run();
    }
    accept();
  });
}

void WebHost::State::tick() {
  timer.expires_after(every);
  timer.async_wait([this](beast::error_code error) {
    if (error) return;
    repeated();
    tick();
  });
}

Response WebHost::State::answer_to(const WebRequest& request) const {
  const bool is_head = request.method == "HEAD";
  if (std::string refused = site.refusal(request); !refused.empty())
    return response_of({403, "text/plain; charset=utf-8", std::move(refused)}, is_head);
  if (!is_head && request.method != "GET") return response_of({405, "text/plain; charset=utf-8", "read only\n"}, false);
  return response_of(site.get(path_of(request.target)), is_head);
}

Response WebHost::State::response_of(HttpAnswer answer, bool is_head) const {
  Response response{static_cast<http::status>(answer.status), 11};
  response.set(http::field::content_type, answer.type);
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");  // a token is nobody else's
  response.set("X-Frame-Options", "DENY");
  if (!is_head) response.body() = std::move(answer.body);
  return response;
}

WebHost::WebHost(WebHostConfig config, WebSite& site) : state_(std::make_unique<State>(std::move(config), site)) {
  state_->listen();
}

WebHost::~WebHost() {
  State& state = *state_;
  if (!state.thread.joinable()) return;
  asio::post(state.io, [&state] {
    beast::error_code ignored;
    state.acceptor.close(ignored);
    state.timer.cancel();
    for (const auto& socket : std::set(state.sockets)) socket->close();  // a copy: who closes may leave
  });
  for (int i = 0; i < 60 && state.num_sockets > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  state.io.stop();
  state.thread.join();
  for (const auto& socket : std::set(state.sockets)) socket->cut();
}

void WebHost::start() {
  State& state = *state_;
  state.accept();
  if (state.repeated) state.tick();
  state.thread = std::thread([&state] { state.io.run(); });
}

void WebHost::post(std::function<void()> work) { asio::post(state_->io, std::move(work)); }

void WebHost::repeat(std::chrono::milliseconds every, std::function<void()> work) {
  state_->every = every;
  state_->repeated = std::move(work);
}

std::uint16_t WebHost::port() const { return state_->port; }

bool WebHost::is_loopback() const { return asio::ip::make_address(state_->config.address).is_loopback(); }

bool WebHost::is_own(std::string_view host) const {
  return is_own_host(host, state_->config.address, state_->port, state_->host_name);
}

std::string WebHost::url(const std::string& token) const {
  std::string address = state_->config.address;
  if (address == "0.0.0.0" || address == "::") address = state_->host_name.empty() ? "localhost" : state_->host_name;
  if (address.find(':') != std::string::npos) address = "[" + address + "]";
  return fmt::format("http://{}:{}/{}{}", address, state_->port, token.empty() ? "" : "?token=", token);
}

const std::string& WebHost::machine_name() const { return state_->host_name; }

std::string random_hex(int num_words) {
  std::random_device device;
  std::string text;
  for (int i = 0; i < num_words; ++i) text += fmt::format("{:08x}", device());
  return text;
}

}  // namespace alidade::live
