#include "alidade/heads/head_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <functional>
#include <list>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/onvif_protocol.h"
#include "alidade/imaging/image_codecs.h"

namespace alidade {
namespace {

constexpr int wait_ms = 50;  // how soon a thread sees that all is over
constexpr std::size_t max_clients = 16;

int listening(const std::string& address, int port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in endpoint{};
  endpoint.sin_family = AF_INET;
  endpoint.sin_port = htons(static_cast<std::uint16_t>(port));
  const int on = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const bool listens = ::inet_pton(AF_INET, address.c_str(), &endpoint.sin_addr) == 1 &&
                       ::bind(socket, reinterpret_cast<const sockaddr*>(&endpoint), sizeof endpoint) == 0 &&
                       ::listen(socket, 16) == 0;
  if (listens) return socket;
  ::close(socket);
  throw InputError(
      fmt::format("port {} of {} cannot be used; give another one, or 0 for any that is free", port, address));
}

std::uint16_t port_of(int socket) {
  sockaddr_in endpoint{};
  socklen_t size = sizeof endpoint;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&endpoint), &size);
  return ntohs(endpoint.sin_port);
}

bool waits_for(int socket, short what) {
  pollfd waiting{socket, what, 0};
  return ::poll(&waiting, 1, wait_ms) > 0;
}

bool send_all(int socket, std::string_view bytes, const std::atomic<bool>& ends) {
  while (!bytes.empty() && !ends) {
    if (!waits_for(socket, POLLOUT)) continue;
    const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return bytes.empty();
}

/// As a request's header says; 0: it does not.
std::size_t body_length(std::string header) {
  for (char& letter : header) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  const std::string_view word = "\r\ncontent-length:";
  const std::size_t at = header.find(word);
  return at == std::string::npos ? 0 : std::strtoul(header.c_str() + at + word.size(), nullptr, 10);
}

/// A port, and a thread for each client.
class Listener {
 public:
  using Serve = std::function<void(int socket)>;
  Listener(const std::string& address, int port, const std::atomic<bool>& ends, Serve serve)
      : socket_(listening(address, port)), ends_(ends), serve_(std::move(serve)), thread_([this] { accept(); }) {}
  /// After `ends` is set.
  ~Listener() {
    thread_.join();
    for (Client& client : clients_) client.thread.join();
    ::close(socket_);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_of(socket_); }

 private:
  struct Client {
    std::thread thread;
    std::atomic<bool> is_over = false;
  };
  void accept() {
    while (!ends_) {
      if (!waits_for(socket_, POLLIN)) continue;
      const int client = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
      if (client < 0) continue;
      if (num_clients_ >= max_clients) {
        ::close(client);
        continue;
      }
      const int on = 1;
      ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      ++num_clients_;
      clients_.remove_if([](Client& each) {
        if (each.is_over) each.thread.join();
        return each.is_over.load();
      });
      Client& last = clients_.emplace_back();
      last.thread = std::thread([this, client, &last] {
        serve_(client);
        ::close(client);
        --num_clients_;
        last.is_over = true;
      });
    }
  }

  int socket_;
  const std::atomic<bool>& ends_;
  Serve serve_;
  std::atomic<std::size_t> num_clients_ = 0;
  std::list<Client> clients_;
  std::thread thread_;
};

}  // namespace

struct HeadServer::State {
  explicit State(const HeadServerConfig& given)
      : config(given), clock(machine_clock()), plant(given.head, clock->now_s()), renderer(given.camera) {}

  HeadServerConfig config;
  std::shared_ptr<HeadClock> clock;
  HeadPlant plant;
  CameraRenderer renderer;
  std::atomic<bool> ends = false;
  std::mutex mutex;
  std::condition_variable changed;
  std::shared_ptr<const std::string> part;
  std::atomic<std::size_t> num_frames = 0;
  int truth = -1;
  std::thread camera;
  std::optional<OnvifCamera> onvif_camera;
  std::optional<Listener> rotctl, stream, onvif;

  void serve_rotctl(int socket) {
    constexpr std::size_t longest_line = 1000;
    std::string buffer;
    char chunk[1024];
    while (!ends) {
      if (!waits_for(socket, POLLIN)) continue;
      const ssize_t got = ::recv(socket, chunk, sizeof chunk, 0);
      if (got <= 0 || buffer.size() > longest_line) return;
      buffer.append(chunk, static_cast<std::size_t>(got));
      for (std::size_t end = 0; (end = buffer.find('\n')) != std::string::npos;) {
        const std::optional<std::string> answer = rotctl_answer(plant, buffer.substr(0, end), clock->now_s());
        buffer.erase(0, end + 1);
        if (!answer || !send_all(socket, *answer, ends)) return;
      }
    }
  }

  void serve_stream(int socket) {
    char request[2048];
    constexpr int max_waits = 100;
    for (int i = 0; !ends && i < max_waits && !waits_for(socket, POLLIN);) ++i;
    if (::recv(socket, request, sizeof request, MSG_DONTWAIT) <= 0) return;
    const std::string_view head =
        "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n"
        "Cache-Control: no-store\r\nConnection: close\r\n\r\n";
    if (!send_all(socket, head, ends)) return;
    std::shared_ptr<const std::string> sent;
    while (!ends) {
      std::unique_lock lock(mutex);
      changed.wait_for(lock, std::chrono::milliseconds(wait_ms), [&] { return part != sent; });
      if (part == sent) continue;
      sent = part;
      lock.unlock();
      if (!send_all(socket, *sent, ends)) return;
    }
  }

  /// One question a connection.
  void serve_onvif(int socket) {
    constexpr std::size_t max_bytes = 1 << 20;
    constexpr int max_waits = 100;
    std::string request;
    std::size_t body = std::string::npos, length = 0;
    char chunk[4096];
    for (int waits = 0; !ends && (body == std::string::npos || request.size() < body + length);) {
      if (!waits_for(socket, POLLIN)) {
        if (++waits > max_waits) return;
        continue;
      }
      const ssize_t got = ::recv(socket, chunk, sizeof chunk, 0);
      if (got <= 0 || request.size() > max_bytes) return;
      request.append(chunk, static_cast<std::size_t>(got));
      const std::size_t end = request.find("\r\n\r\n");
      if (body != std::string::npos || end == std::string::npos) continue;
      body = end + 4;
      length = body_length(request.substr(0, end));
      if (length > max_bytes) return;
    }
    const OnvifCamera::Answer answer =
        onvif_camera->answer(request.substr(std::min(body, request.size())), clock->now_s());
    (void)send_all(
        socket,
        fmt::format("HTTP/1.1 {}\r\nContent-Type: application/soap+xml; charset=utf-8\r\nContent-Length: {}\r\n"
                    "Connection: close\r\n\r\n{}",
                    answer.status == 200 ? "200 OK" : fmt::format("{} Refused", answer.status), answer.body.size(),
                    answer.body),
        ends);
  }

  void film() {
    const double period_s = 1.0 / config.camera.fps;
    for (double next_s = clock->now_s(); !ends; next_s = std::max(next_s + period_s, clock->now_s())) {
      clock->wait_until(next_s);
      const double t_s = clock->now_s(), stamp_s = stamp_of(config.camera, t_s);
      const Eigen::Vector2d angles = plant.truth(t_s);
      const std::size_t number = ++num_frames;
      const std::string jpeg = jpeg_bytes(renderer.frame(angles, number, t_s), 95);
      auto made = std::make_shared<const std::string>(
          fmt::format("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\nX-Frame: {}\r\nX-Timestamp: "
                      "{:.6f}\r\n\r\n",
                      jpeg.size(), number, stamp_s) +
          jpeg + "\r\n");
      const std::string row =
          fmt::format("{},{:.6f},{:.6f},{:.9f},{:.9f}\n", number, stamp_s, t_s, angles[0], angles[1]);
      if (truth >= 0 && ::write(truth, row.data(), row.size()) < 0) ::close(std::exchange(truth, -1));
      const std::scoped_lock lock(mutex);
      part = std::move(made);
      changed.notify_all();
    }
  }
};

HeadServer::HeadServer(const HeadServerConfig& config) : state_(std::make_unique<State>(config)) {
  State& state = *state_;
  if (!config.truth_csv.empty()) {
    const std::string header = "frame,t_s,t_angle_s,pan_rad,tilt_rad\n";
    state.truth = ::open(config.truth_csv.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (state.truth < 0 || ::write(state.truth, header.data(), header.size()) < 0)
      throw InputError(config.truth_csv + ": cannot be written");
  }
  try {
    if (config.rotctl_port >= 0)
      state.rotctl.emplace(config.address, config.rotctl_port, state.ends, [&state](int s) { state.serve_rotctl(s); });
    if (config.stream_port >= 0)
      state.stream.emplace(config.address, config.stream_port, state.ends, [&state](int s) { state.serve_stream(s); });
    if (config.onvif_port >= 0) {
      const std::string images = fmt::format("http://{}:{}/stream.mjpg", config.address, stream_port());
      state.onvif_camera.emplace(state.plant,
                                 OnvifServerConfig{config.user, config.password, config.address, 80, images,
                                                   config.camera.width_px, config.camera.height_px});
      state.onvif.emplace(config.address, config.onvif_port, state.ends, [&state](int s) { state.serve_onvif(s); });
      state.onvif_camera->set_port(state.onvif->port());
    }
  } catch (...) {
    state.ends = true;
    state.rotctl.reset();
    state.stream.reset();
    throw;
  }
  if (config.stream_port >= 0) state.camera = std::thread([&state] { state.film(); });
}

HeadServer::~HeadServer() {
  state_->ends = true;
  if (state_->camera.joinable()) state_->camera.join();
  state_->rotctl.reset();
  state_->stream.reset();
  state_->onvif.reset();
  if (state_->truth >= 0) ::close(state_->truth);
}

std::uint16_t HeadServer::rotctl_port() const { return state_->rotctl ? state_->rotctl->port() : 0; }
std::uint16_t HeadServer::stream_port() const { return state_->stream ? state_->stream->port() : 0; }
std::uint16_t HeadServer::onvif_port() const { return state_->onvif ? state_->onvif->port() : 0; }
std::size_t HeadServer::num_frames() const { return state_->num_frames; }
HeadPlant& HeadServer::plant() { return state_->plant; }

}  // namespace alidade
