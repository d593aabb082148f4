#include <chrono>
#include <string>
#include <thread>

#include "alidade/live/server.h"
#include "cli/app/terminal.h"
#include "cli/fleet/watch_lot.h"
#include "cli/fleet/watch_page.h"
#include "cli/fleet/worker.h"

namespace alidade::fleet {
namespace {

live::HttpAnswer answer_of(std::string_view path, WatchedLot& lot) {
  constexpr std::string_view folder = "/camera/", ending = ".json";
  if (path == "/") return {200, "text/html; charset=utf-8", watch_page};
  if (path == "/fleet.json") return {200, "application/json", lot.fleet_text()};
  if (path.starts_with(folder) && path.ends_with(ending)) {
    path.remove_prefix(folder.size());
    path.remove_suffix(ending.size());
    std::string text = lot.camera_text(std::string(path));
    if (!text.empty()) return {200, "application/json", std::move(text)};
  }
  return {};
}

std::string text_of(const Message& message) {
  return {natsMsg_GetData(message.get()), static_cast<std::size_t>(natsMsg_GetDataLength(message.get()))};
}

/// Follows one stream from its beginning, and resumes at its position after the broker was away.
class Follower {
 public:
  Follower(Broker& broker, std::string stream, std::string subject)
      : broker_(broker), stream_(std::move(stream)), subject_(std::move(subject)) {}

  template <typename Take>
  void follow(const Take& take) {
    if (broker_.num_reconnects() != reconnects_) subscription_.reset();
    reconnects_ = broker_.num_reconnects();
    if (!subscription_) subscription_ = broker_.read(stream_, subject_, next_);
    bool is_lost = !subscription_;
    while (!is_lost) {
      const Message message = Broker::next(subscription_, 10, is_lost);
      if (!message) break;
      if (const auto place = place_of(message)) next_ = place->sequence + 1;
      take(text_of(message));
    }
    if (is_lost) subscription_.reset();
  }

 private:
  Broker& broker_;
  std::string stream_, subject_;
  Subscription subscription_;
  std::uint64_t next_ = 1;
  int reconnects_ = 0;
};

}  // namespace

ExitCode run_watch(const cli::FleetWatchOptions& options, cli::Run& run) {
  Broker broker(broker_options(options.broker));
  WatchedLot lot;
  live::ServerConfig config;
  config.port = static_cast<std::uint16_t>(options.port);
  config.get = [&lot](std::string_view path) { return answer_of(path, lot); };
  const live::Server server(std::move(config));
  cli::tell_person("the fleet: " + server.url());
  Follower states(broker, "ALIDADE_STATE", "cam.*.state"), alarms(broker, "ALIDADE_ALARM", "cam.*.alarm");
  while (!run.progress || run.progress("watching", 0, 0)) {
    if (!broker.is_connected() || !broker.make_streams()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      continue;
    }
    states.follow([&](const std::string& text) { lot.take_state(text); });
    alarms.follow([&](const std::string& text) { lot.take_alarm(text); });
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return ExitCode::ok;
}

}  // namespace alidade::fleet
