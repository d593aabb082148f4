#include "alidade/live/capture/capture_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "alidade/live/protocol.h"

namespace alidade::live {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t max_pages = 8;
constexpr std::size_t max_message_bytes = 64u << 20;  // an image of 60 megapixels
constexpr std::size_t header_bytes = 16;
constexpr int max_images_per_s = 120, max_side_px = 16384;
constexpr std::size_t max_waiting = 64;  // messages for one page

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return number;
}

}  // namespace

std::optional<SentImage> sent_image(std::string_view message) {
  constexpr std::uint32_t magic = 0x31594441;  // "ADY1"
  if (message.size() < header_bytes || number_at(message, 0) != magic) return std::nullopt;
  const std::uint32_t width = number_at(message, 4), height = number_at(message, 8);
  const bool has_size = width >= 1 && height >= 1 && width <= max_side_px && height <= max_side_px;
  if (!has_size || message.size() - header_bytes != std::size_t{width} * height) return std::nullopt;
  return SentImage{static_cast<int>(width), static_cast<int>(height), number_at(message, 12) == 1,
                   std::string(message.substr(header_bytes))};
}

bool is_own_origin(std::string_view origin, std::string_view address, std::uint16_t port,
                   std::string_view machine_name) {
  constexpr std::string_view scheme = "http://";
  return origin.starts_with(scheme) && is_own_host(origin.substr(scheme.size()), address, port, machine_name);
}

class Page;

struct CaptureServer::State : WebSite {
  explicit State(CaptureServerConfig given)
      : config(std::move(given)), host({config.address, config.port, max_message_bytes}, *this) {
    host.start();
  }

  CaptureServerConfig config;
  std::string token = random_hex(4);
  std::vector<std::shared_ptr<Page>> pages;  ///< The first is in control.
  std::atomic<std::size_t> num_pages{0};
  std::map<std::string, std::string> kept;

  std::mutex mutex;  ///< Of what pages sent.
  std::condition_variable has_come;
  std::optional<SentImage> image;
  std::vector<PageCommand> asked;
  WebHost host;  // last: its thread uses the others

  void leave(const Page& page);
  [[nodiscard]] bool is_in_control(const Page& page) const { return !pages.empty() && pages.front().get() == &page; }
  [[nodiscard]] std::string refusal(const WebRequest& request) const override;
  [[nodiscard]] HttpAnswer get(std::string_view path) const override { return config.get(path); }
  [[nodiscard]] Socket socket(const WebRequest& request) override;
};

/// One socket of a page; all of it runs on the server's thread.
class Page : public SocketUser {
 public:
  explicit Page(CaptureServer::State& server) : server_(server) {}

  void opened() override {
    say_control();
    for (const auto& [kind, message] : server_.kept) send(message, true);
  }

  void say_control() {
    send(server_.is_in_control(*this) ? R"({"op":"control","yes":true})" : R"({"op":"control","yes":false})", true);
  }

  void send(std::string message, bool is_text) {
    if (waiting_.size() >= max_waiting) waiting_.pop_front();
    waiting_.push_back({.is_text = is_text, .head = std::move(message), .body = nullptr});
    if (socket != nullptr) socket->write();
  }
  /// An image that waits already is not joined by another.
  [[nodiscard]] bool takes_image() const {
    return std::ranges::all_of(waiting_, [](const Outgoing& one) { return one.is_text; });
  }

  [[nodiscard]] bool has_next() override { return !waiting_.empty(); }
  [[nodiscard]] Outgoing next() override {
    Outgoing first = std::move(waiting_.front());
    waiting_.pop_front();
    return first;
  }
  void left() override {
    socket = nullptr;
    server_.leave(*this);
  }

  /// False: what no page of ours sends.
  bool hear(std::string_view data, bool is_text) override {
    if (is_text) return hear_text(data);
    std::optional<SentImage> image = sent_image(data);
    if (!image || !is_within_rate()) return false;
    if (!server_.is_in_control(*this)) return true;
    const std::scoped_lock lock(server_.mutex);
    server_.image = std::move(image);
    server_.has_come.notify_all();
    return true;
  }

 private:
  bool hear_text(std::string_view text) {
    constexpr std::size_t most = 1024, max_asked = 64;
    if (text.size() > most) return false;
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("op") || !json["op"].is_string()) return false;
    if (!server_.is_in_control(*this)) return true;
    PageCommand command{json["op"].get<std::string>()};
    if (json.contains("value") && json["value"].is_number()) command.value = json["value"].get<double>();
    const std::scoped_lock lock(server_.mutex);
    if (server_.asked.size() < max_asked) server_.asked.push_back(std::move(command));
    server_.has_come.notify_all();
    return true;
  }
  bool is_within_rate() {
    const auto now = Clock::now();
    if (now - second_ > std::chrono::seconds(1)) {
      second_ = now;
      num_in_second_ = 0;
    }
    return ++num_in_second_ <= max_images_per_s;
  }

  CaptureServer::State& server_;
  std::deque<Outgoing> waiting_;
  Clock::time_point second_{};
  int num_in_second_ = 0;
};

void CaptureServer::State::leave(const Page& page) {
  const auto at = std::ranges::find(pages, &page, [](const auto& one) { return one.get(); });
  if (at == pages.end()) return;
  const bool was_in_control = at == pages.begin();
  pages.erase(at);
  num_pages = pages.size();
  if (was_in_control && !pages.empty()) pages.front()->say_control();
}

std::string CaptureServer::State::refusal(const WebRequest& request) const {
  const bool is_own_page =
      !request.origin || is_own_origin(*request.origin, config.address, host.port(), host.machine_name());
  const bool needs_token = request.wants_socket || path_of(request.target) != "/favicon.ico";
  if (host.is_own(request.host) && is_own_page && (!needs_token || has_token(request.target, token))) return "";
  return "forbidden: another Host or Origin than this server's, or no token\n";
}

WebSite::Socket CaptureServer::State::socket(const WebRequest& request) {
  if (path_of(request.target) != "/capture") return {};
  if (pages.size() >= max_pages)
    return {nullptr, "",
            HttpAnswer{503, "text/plain; charset=utf-8", fmt::format("{} pages are open, no more\n", max_pages)}};
  pages.push_back(std::make_shared<Page>(*this));
  num_pages = pages.size();
  return {pages.back(), "", std::nullopt};
}

CaptureServer::CaptureServer(CaptureServerConfig config) : state_(std::make_unique<State>(std::move(config))) {}

CaptureServer::~CaptureServer() = default;

std::string CaptureServer::url() const { return state_->host.url(state_->token); }

std::size_t CaptureServer::num_clients() const { return state_->num_pages; }

std::optional<SentImage> CaptureServer::wait_for_image(std::chrono::milliseconds most) {
  State& state = *state_;
  std::unique_lock lock(state.mutex);
  state.has_come.wait_for(lock, most, [&] { return state.image || !state.asked.empty(); });
  return std::exchange(state.image, std::nullopt);
}

std::vector<PageCommand> CaptureServer::commands() {
  const std::scoped_lock lock(state_->mutex);
  return std::exchange(state_->asked, {});
}

void CaptureServer::tell(std::string json, const std::string& kind) {
  state_->host.post([&state = *state_, json = std::move(json), kind] {
    for (const auto& page : std::vector(state.pages)) page->send(json, true);  // a copy: who writes may leave
    if (!kind.empty()) state.kept[kind] = json;
  });
}

void CaptureServer::show(std::string jpeg, bool also_control) {
  state_->host.post([&state = *state_, jpeg = std::move(jpeg), also_control] {
    for (const auto& page : std::vector(state.pages)) {
      if ((also_control || !state.is_in_control(*page)) && page->takes_image()) page->send(jpeg, false);
    }
  });
}

void CaptureServer::finish(double max_s) {
  const auto until = Clock::now() + std::chrono::duration<double>(max_s);
  while (num_clients() > 0 && Clock::now() < until) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

}  // namespace alidade::live
