// Boost.Beast again: compiled alone, as server.cpp.
#include "alidade/live/capture_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <future>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/live/protocol.h"

namespace alidade::live {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;
using Clock = std::chrono::steady_clock;

constexpr std::size_t max_pages = 8;
constexpr std::size_t max_message_bytes = 64u << 20;  // a picture of 60 megapixels
constexpr std::size_t header_bytes = 16;
constexpr int max_pictures_per_s = 120, max_side_px = 16384;
constexpr std::size_t max_waiting = 64;  // messages for one page

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return number;
}

}  // namespace

std::optional<SentPicture> sent_picture(std::string_view message) {
  constexpr std::uint32_t magic = 0x31594441;  // "ADY1"
  if (message.size() < header_bytes || number_at(message, 0) != magic) return std::nullopt;
  const std::uint32_t width = number_at(message, 4), height = number_at(message, 8);
  const bool has_size = width >= 1 && height >= 1 && width <= max_side_px && height <= max_side_px;
  if (!has_size || message.size() - header_bytes != std::size_t{width} * height) return std::nullopt;
  return SentPicture{static_cast<int>(width), static_cast<int>(height), number_at(message, 12) == 1,
                     std::string(message.substr(header_bytes))};
}

bool is_own_origin(std::string_view origin, std::string_view address, std::uint16_t port,
                   std::string_view machine_name) {
  constexpr std::string_view scheme = "http://";
  return origin.starts_with(scheme) && is_own_host(origin.substr(scheme.size()), address, port, machine_name);
}

class Page;

struct CaptureServer::State {
  explicit State(CaptureServerConfig given) : config(std::move(given)) {}

  CaptureServerConfig config;
  std::size_t num_connections = 0;  // outlives what counts in it
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  std::string token = random_hex(4), host_name = machine_name();
  std::uint16_t port = 0;
  std::vector<std::shared_ptr<Page>> pages;  ///< The first is in control.
  std::atomic<std::size_t> num_pages{0};
  std::map<std::string, std::string> kept;

  std::mutex mutex;  ///< Of what pages sent.
  std::condition_variable has_come;
  std::optional<SentPicture> picture;
  std::vector<std::string> asked;

  std::thread thread;

  void listen();
  void accept();
  void leave(const std::shared_ptr<Page>& page);
  [[nodiscard]] bool is_in_control(const Page& page) const { return !pages.empty() && pages.front().get() == &page; }
  [[nodiscard]] bool is_allowed(const Request& request, bool needs_token) const;
  [[nodiscard]] Response answer_to(const Request& request) const;
};

/// One socket of a page; all of it runs on the server's thread.
class Page : public std::enable_shared_from_this<Page> {
 public:
  Page(beast::tcp_stream&& stream, CaptureServer::State& server) : socket_(std::move(stream)), server_(server) {}

  void run(Request request) {
    request_ = std::move(request);
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{patience, silence, true});
    socket_.read_message_max(max_message_bytes);
    socket_.async_accept(request_, [self = shared_from_this()](beast::error_code error) {
      if (error) return self->server_.leave(self);
      self->is_open_ = true;
      self->say_control();
      for (const auto& [kind, message] : self->server_.kept) self->send(message, true);
      self->read();
      self->write();
    });
  }

  void say_control() {
    send(server_.is_in_control(*this) ? R"({"op":"control","yes":true})" : R"({"op":"control","yes":false})", true);
  }

  void send(std::string message, bool is_text) {
    if (waiting_.size() >= max_waiting) waiting_.pop_front();
    waiting_.push_back({std::move(message), is_text});
    write();
  }
  [[nodiscard]] bool is_idle() const { return waiting_.empty() && !is_writing_; }
  void close() {
    if (std::exchange(is_open_, false))
      socket_.async_close(websocket::close_code::going_away, [self = shared_from_this()](beast::error_code) {});
  }
  void cut() { beast::get_lowest_layer(socket_).close(); }

 private:
  void write() {
    if (!is_open_ || is_writing_ || waiting_.empty()) return;
    is_writing_ = true;
    sending_ = std::move(waiting_.front());
    waiting_.pop_front();
    socket_.text(sending_.second);
    socket_.async_write(asio::buffer(sending_.first),
                        [self = shared_from_this()](beast::error_code error, std::size_t) {
                          self->is_writing_ = false;
                          if (error) return self->server_.leave(self);
                          self->write();
                        });
  }

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->server_.leave(self);
      if (!self->hear()) return self->refuse();
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }

  /// False: what no page of ours sends.
  bool hear() {
    const std::string_view data(static_cast<const char*>(buffer_.cdata().data()), buffer_.size());
    if (socket_.got_text()) return hear_text(data);
    std::optional<SentPicture> picture = sent_picture(data);
    if (!picture || !is_within_rate()) return false;
    if (!server_.is_in_control(*this)) return true;
    const std::scoped_lock lock(server_.mutex);
    server_.picture = std::move(picture);
    server_.has_come.notify_all();
    return true;
  }
  bool hear_text(std::string_view text) {
    constexpr std::size_t most = 1024, most_asked = 64;
    if (text.size() > most) return false;
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("op") || !json["op"].is_string()) return false;
    if (!server_.is_in_control(*this)) return true;
    const std::scoped_lock lock(server_.mutex);
    if (server_.asked.size() < most_asked) server_.asked.push_back(json["op"].get<std::string>());
    server_.has_come.notify_all();
    return true;
  }
  bool is_within_rate() {
    const auto now = Clock::now();
    if (now - second_ > std::chrono::seconds(1)) {
      second_ = now;
      num_in_second_ = 0;
    }
    return ++num_in_second_ <= max_pictures_per_s;
  }
  void refuse() {
    is_open_ = false;
    socket_.async_close(websocket::close_code::policy_error,
                        [self = shared_from_this()](beast::error_code) { self->server_.leave(self); });
  }

  websocket::stream<beast::tcp_stream> socket_;
  CaptureServer::State& server_;
  Request request_;
  beast::flat_buffer buffer_;
  std::deque<std::pair<std::string, bool>> waiting_;
  std::pair<std::string, bool> sending_;
  bool is_open_ = false, is_writing_ = false;
  Clock::time_point second_{};
  int num_in_second_ = 0;
};

namespace {

/// One request and its answer; or the beginning of a socket.
class CaptureConnection : public std::enable_shared_from_this<CaptureConnection> {
 public:
  CaptureConnection(tcp::socket&& socket, CaptureServer::State& server) : stream_(std::move(socket)), server_(server) {
    ++server_.num_connections;
    parser_.header_limit(8 * 1024);
    parser_.body_limit(1024);
  }
  ~CaptureConnection() { --server_.num_connections; }
  CaptureConnection(const CaptureConnection&) = delete;
  CaptureConnection& operator=(const CaptureConnection&) = delete;

  void run() {
    stream_.expires_after(patience);
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (!error) self->handle(self->parser_.release());
    });
  }

 private:
  void handle(Request request) {
    const auto target = request.target();
    const bool is_socket = websocket::is_upgrade(request) && path_of({target.data(), target.size()}) == "/capture";
    if (!is_socket || !server_.is_allowed(request, true) || server_.pages.size() >= max_pages)
      return send(server_.answer_to(request));
    const auto page = std::make_shared<Page>(std::move(stream_), server_);
    server_.pages.push_back(page);
    server_.num_pages = server_.pages.size();
    page->run(std::move(request));
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
  CaptureServer::State& server_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  Response response_;
};

}  // namespace

void CaptureServer::State::listen() {
  beast::error_code error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) throw InputError("--live-address: '" + config.address + "' is not a numeric address");
  const tcp::endpoint endpoint(address, config.port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error == asio::error::address_in_use)
    throw InputError(fmt::format("--live: port {} of {} is in use; give another one, or 0 for any that is free",
                                 config.port, config.address));
  if (error) throw InputError(fmt::format("--live: port {} of {}: {}", config.port, config.address, error.message()));
  port = acceptor.local_endpoint().port();
}

void CaptureServer::State::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && num_connections < max_connections) {
      socket.set_option(tcp::no_delay(true), error);
      std::make_shared<CaptureConnection>(std::move(socket), *this)->run();
    }
    accept();
  });
}

void CaptureServer::State::leave(const std::shared_ptr<Page>& page) {
  const auto at = std::ranges::find(pages, page);
  if (at == pages.end()) return;
  const bool was_in_control = at == pages.begin();
  pages.erase(at);
  num_pages = pages.size();
  if (was_in_control && !pages.empty()) pages.front()->say_control();
}

bool CaptureServer::State::is_allowed(const Request& request, bool needs_token) const {
  const auto host = request[http::field::host], origin = request[http::field::origin];
  const auto target = request.target();
  const bool has_origin = request.find(http::field::origin) != request.end();
  return is_own_host({host.data(), host.size()}, config.address, port, host_name) &&
         (!has_origin || is_own_origin({origin.data(), origin.size()}, config.address, port, host_name)) &&
         (!needs_token || has_token({target.data(), target.size()}, token));
}

Response CaptureServer::State::answer_to(const Request& request) const {
  const auto target = request.target();
  const std::string_view path = path_of({target.data(), target.size()});
  const bool is_head = request.method() == http::verb::head;
  HttpAnswer answer{403, "text/plain; charset=utf-8",
                    "forbidden: another Host or Origin than this server's, or no token\n"};
  if (is_allowed(request, path != "/favicon.ico")) {
    answer = is_head || request.method() == http::verb::get
                 ? config.get(path)
                 : HttpAnswer{405, "text/plain; charset=utf-8", "pictures come by the socket /capture\n"};
    if (websocket::is_upgrade(request) && path == "/capture")
      answer = {503, "text/plain; charset=utf-8", fmt::format("{} pages are open, no more\n", max_pages)};
  }
  Response response{static_cast<http::status>(answer.status), request.version()};
  response.set(http::field::content_type, answer.type);
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("X-Frame-Options", "DENY");
  if (!is_head) response.body() = std::move(answer.body);
  return response;
}

CaptureServer::CaptureServer(CaptureServerConfig config) : state_(std::make_unique<State>(std::move(config))) {
  State& state = *state_;
  state.listen();
  state.accept();
  state.thread = std::thread([&state] { state.io.run(); });
}

CaptureServer::~CaptureServer() {
  State& state = *state_;
  asio::post(state.io, [&state] {
    state.acceptor.close();
    for (const auto& page : state.pages) page->close();
  });
  for (int i = 0; i < 40 && state.num_pages > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  state.io.stop();
  state.thread.join();
  for (const auto& page : state.pages) page->cut();
}

std::string CaptureServer::url() const {
  std::string address = state_->config.address;
  if (address == "0.0.0.0" || address == "::") address = state_->host_name.empty() ? "localhost" : state_->host_name;
  if (address.find(':') != std::string::npos) address = "[" + address + "]";
  return fmt::format("http://{}:{}/?token={}", address, state_->port, state_->token);
}

std::size_t CaptureServer::num_clients() const { return state_->num_pages; }

std::optional<SentPicture> CaptureServer::wait_for_picture(std::chrono::milliseconds most) {
  State& state = *state_;
  std::unique_lock lock(state.mutex);
  state.has_come.wait_for(lock, most, [&] { return state.picture || !state.asked.empty(); });
  return std::exchange(state.picture, std::nullopt);
}

std::vector<std::string> CaptureServer::commands() {
  const std::scoped_lock lock(state_->mutex);
  return std::exchange(state_->asked, {});
}

void CaptureServer::tell(std::string json, const std::string& kind) {
  asio::post(state_->io, [&state = *state_, json = std::move(json), kind] {
    for (const auto& page : std::vector(state.pages)) page->send(json, true);  // a copy: who writes may leave
    if (!kind.empty()) state.kept[kind] = json;
  });
}

void CaptureServer::show(std::string jpeg, bool also_control) {
  asio::post(state_->io, [&state = *state_, jpeg = std::move(jpeg), also_control] {
    for (const auto& page : std::vector(state.pages)) {
      if ((also_control || !state.is_in_control(*page)) && page->is_idle()) page->send(jpeg, false);
    }
  });
}

void CaptureServer::finish(double max_s) {
  const auto until = Clock::now() + std::chrono::duration<double>(max_s);
  while (num_clients() > 0 && Clock::now() < until) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

}  // namespace alidade::live
