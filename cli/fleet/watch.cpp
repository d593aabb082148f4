#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "alidade/live/server.h"
#include "cli/app/terminal.h"
#include "cli/fleet/watch_page.h"
#include "cli/fleet/worker.h"

namespace alidade::fleet {
namespace {

using nlohmann::json;

constexpr std::size_t max_history = 300, max_alarms = 50, max_worst = 100;

/// What is known of a camera, as its states and alarms say.
struct Watched {
  json state;
  std::deque<json> history;
  std::deque<std::string> alarms;
  std::size_t num_alarms = 0;
};

int badness(const json& state) {
  static const std::map<std::string, int> ranks{{"bad", 4}, {"not_converged", 3}, {"care", 2}, {"refused", 1}};
  const auto found = ranks.find(state["verdict"]["state"].get<std::string>());
  return found == ranks.end() ? 0 : found->second;
}

/// All cameras; states come in one thread, questions in another.
class Lot {
 public:
  void take_state(const std::string& payload) {
    try {
      json state = json::parse(payload);
      const json& estimate = state.at("estimate");
      (void)badness(state);
      const std::scoped_lock lock(mutex_);
      Watched& camera = cameras_[state.at("camera").get<std::string>()];
      camera.history.push_back({{"t", state.at("t")},
                                {"fx", estimate.at("fx")},
                                {"pan_zero_rad", estimate.at("pan_zero_rad")},
                                {"tilt_zero_rad", estimate.at("tilt_zero_rad")}});
      if (camera.history.size() > max_history) camera.history.pop_front();
      camera.state = std::move(state);
    } catch (const std::exception&) {  // not a worker's: left alone
    }
  }

  void take_alarm(const std::string& payload) {
    try {
      const json alarm = json::parse(payload);
      const std::scoped_lock lock(mutex_);
      Watched& camera = cameras_[alarm.at("camera").get<std::string>()];
      camera.alarms.push_back(
          fmt::format("{} (n {})", alarm.at("sentence").get<std::string>(), alarm.at("n").get<std::int64_t>()));
      if (camera.alarms.size() > max_alarms) camera.alarms.pop_front();
      ++camera.num_alarms;
      ++num_alarms_;
    } catch (const std::exception&) {
    }
  }

  [[nodiscard]] std::string fleet_text() {
    const std::scoped_lock lock(mutex_);
    json answer{{"cameras", cameras_.size()}, {"alarms", num_alarms_}, {"verdicts", json::object()}};
    answer["map"] = answer["worst"] = json::array();
    std::vector<std::pair<int, const Watched*>> order;
    for (const auto& [id, camera] : cameras_) {
      if (camera.state.is_null()) continue;
      const std::string state = camera.state["verdict"]["state"];
      answer["verdicts"][state] = answer["verdicts"].value(state, 0) + 1;
      answer["map"].push_back({id, state});
      order.emplace_back(badness(camera.state), &camera);
    }
    std::ranges::stable_sort(order, [](const auto& a, const auto& b) {
      return std::pair(a.first, a.second->num_alarms) > std::pair(b.first, b.second->num_alarms);
    });
    for (std::size_t i = 0; i < std::min(order.size(), max_worst); ++i) {
      json one = order[i].second->state;
      one["alarms"] = order[i].second->num_alarms;
      answer["worst"].push_back(std::move(one));
    }
    return answer.dump();
  }

  [[nodiscard]] std::string camera_text(const std::string& id) {
    const std::scoped_lock lock(mutex_);
    const auto found = cameras_.find(id);
    if (found == cameras_.end() || found->second.state.is_null()) return "";
    return json{{"camera", id},
                {"sentence", found->second.state["verdict"]["sentence"]},
                {"state", found->second.state},
                {"history", found->second.history},
                {"alarms", found->second.alarms}}
        .dump();
  }

 private:
  std::mutex mutex_;
  std::map<std::string, Watched> cameras_;
  std::size_t num_alarms_ = 0;
};

live::HttpAnswer answer_of(std::string_view path, Lot& lot) {
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

/// Follows one stream from its beginning, and begins again at the place it was where the broker was away.
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
  Lot lot;
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
