#include "cli/fleet/watch_lot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

namespace alidade::fleet {
namespace {

using nlohmann::json;

constexpr std::size_t max_alarms = 50, max_worst = 100;
constexpr std::array<const char*, 3> names{"pan_zero_rad", "tilt_zero_rad", "fx"};

int badness(const std::string& state) {
  static const std::map<std::string, int> ranks{{"bad", 4}, {"not_converged", 3}, {"care", 2}, {"refused", 1}};
  const auto found = ranks.find(state);
  return found == ranks.end() ? 0 : found->second;
}

double number_in(const json& object, const char* name) {
  const json& value = object.at(name);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::array<double, 3> numbers_in(const json& object) {
  std::array<double, 3> values{};
  for (std::size_t i = 0; i < names.size(); ++i) values[i] = number_in(object, names[i]);
  return values;
}

json history_json(const History& history) {
  json all = json::array();
  for (const WatchedStep& step : history.steps()) {
    json one{{"t", history.first_t_s() + static_cast<double>(step.t_s)}};
    for (std::size_t i = 0; i < names.size(); ++i) {
      one[names[i]] = history.first()[i] + static_cast<double>(step.value[i]);
      one[std::string("sigma_") + names[i]] = static_cast<double>(step.sigma[i]);
    }
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace

void History::add(double t_s, const std::array<double, 3>& value, const std::array<double, 3>& sigma) {
  if (steps_.empty()) {
    first_ = value;
    first_t_s_ = t_s;
  }
  if (since_++ % stride_ != 0) return;
  WatchedStep step{static_cast<float>(t_s - first_t_s_), {}, {}};
  for (std::size_t i = 0; i < value.size(); ++i) {
    step.value[i] = static_cast<float>(value[i] - first_[i]);
    step.sigma[i] = static_cast<float>(sigma[i]);
  }
  steps_.push_back(step);
  if (steps_.size() < most) return;
  for (std::size_t i = 0; 2 * i < steps_.size(); ++i) steps_[i] = steps_[2 * i];
  steps_.resize((steps_.size() + 1) / 2);
  stride_ *= 2;
}

void WatchedLot::take_state(const std::string& payload) {
  try {
    const json state = json::parse(payload);
    const std::array<double, 3> value = numbers_in(state.at("estimate")), sigma = numbers_in(state.at("stddev"));
    std::string word = state.at("verdict").at("state").get<std::string>();
    (void)state.at("verdict").at("sentence").get<std::string>();
    const double t_s = number_in(state, "t");
    const std::scoped_lock lock(mutex_);
    Camera& camera = cameras_[state.at("camera").get<std::string>()];
    // Before it is initialised there is nothing to draw.
    if (std::isfinite(value[2]) && std::isfinite(t_s)) camera.history.add(t_s, value, sigma);
    camera.state = std::move(word);
    camera.state_text = payload;
  } catch (const std::exception&) {  // not a worker's
  }
}

void WatchedLot::take_alarm(const std::string& payload) {
  try {
    const json alarm = json::parse(payload);
    (void)alarm.at("sentence").get<std::string>();
    const std::scoped_lock lock(mutex_);
    Camera& camera = cameras_[alarm.at("camera").get<std::string>()];
    camera.alarms.push_back(payload);
    if (camera.alarms.size() > max_alarms) camera.alarms.pop_front();
    ++camera.num_alarms;
    ++num_alarms_;
  } catch (const std::exception&) {
  }
}

std::string WatchedLot::fleet_text() {
  const std::scoped_lock lock(mutex_);
  json answer{{"cameras", cameras_.size()}, {"alarms", num_alarms_}, {"verdicts", json::object()}};
  answer["map"] = answer["worst"] = json::array();
  std::vector<std::pair<int, decltype(cameras_)::const_iterator>> order;
  for (auto at = cameras_.cbegin(); at != cameras_.cend(); ++at)
    if (!at->second.state.empty()) order.emplace_back(badness(at->second.state), at);
  std::ranges::stable_sort(order, [](const auto& a, const auto& b) {
    return std::pair(a.first, a.second->second.num_alarms) > std::pair(b.first, b.second->second.num_alarms);
  });
  for (const auto& [rank, at] : order) {
    const auto& [id, camera] = *at;
    answer["verdicts"][camera.state] = answer["verdicts"].value(camera.state, 0) + 1;
    answer["map"].push_back({id, camera.state, camera.num_alarms});
    if (answer["worst"].size() == max_worst) continue;
    json one = json::parse(camera.state_text);
    one["alarms"] = camera.num_alarms;
    answer["worst"].push_back(std::move(one));
  }
  return answer.dump();
}

std::string WatchedLot::camera_text(const std::string& id) {
  const std::scoped_lock lock(mutex_);
  const auto found = cameras_.find(id);
  if (found == cameras_.end() || found->second.state.empty()) return "";
  const Camera& camera = found->second;
  const json state = json::parse(camera.state_text);
  json alarms = json::array();
  for (const std::string& alarm : camera.alarms) alarms.push_back(json::parse(alarm));
  return json{{"camera", id},
              {"sentence", state["verdict"]["sentence"]},
              {"state", state},
              {"history", history_json(camera.history)},
              {"alarms", alarms}}
      .dump();
}

}  // namespace alidade::fleet
