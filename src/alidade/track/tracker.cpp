#include "alidade/track/tracker.h"

#include <array>
#include <utility>
#include <variant>

#include "alidade/track/target_filter.h"
#include "alidade/track/track_engine.h"

namespace alidade {
namespace {

template <class Model>
using EngineOf = detail::TrackEngine<ModelFilter<Model>>;
using Engine = std::variant<EngineOf<ConstantVelocity>, EngineOf<Singer>, EngineOf<CoordinatedTurn>,
                            EngineOf<MeanReverting>, detail::TrackEngine<InteractingFilter>>;

constexpr double share_of_acceleration_beside_turning = 0.3, share_while_quiet = 0.15;
constexpr double start_sigma_turn_rad_s = 1.0;

Engine engine_for(std::vector<RigHead> heads, const TrackerConfig& config) {
  const double sigma_a = config.sigma_a_m_s2;
  const Singer singer{sigma_a, config.singer_tau_s};
  switch (config.method) {
    case TrackMethod::singer:
      return EngineOf<Singer>(std::move(heads), config, {singer, sigma_a});
    case TrackMethod::turn:
      return EngineOf<CoordinatedTurn>(
          std::move(heads), config,
          {CoordinatedTurn{share_of_acceleration_beside_turning * sigma_a}, start_sigma_turn_rad_s});
    case TrackMethod::resting:
      return EngineOf<MeanReverting>(std::move(heads), config,
                                     {MeanReverting{config.resting_sigma_v_m_s, config.resting_tau_s}});
    case TrackMethod::imm:
      return detail::TrackEngine<InteractingFilter>(
          std::move(heads), config, InteractingModels{ConstantVelocity{share_while_quiet * sigma_a}, singer});
    case TrackMethod::cv:
      break;
  }
  return EngineOf<ConstantVelocity>(std::move(heads), config, {ConstantVelocity{sigma_a}});
}

}  // namespace

struct Tracker::State {
  Engine engine;
};

Tracker::Tracker(std::vector<RigHead> heads, const TrackerConfig& config)
    : state_(std::make_unique<State>(State{engine_for(std::move(heads), config)})) {}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;

TrackStep Tracker::take(const TargetSight& sight) {
  return std::visit([&](auto& engine) { return engine.take(sight); }, state_->engine);
}

std::optional<Belief<6>> Tracker::at(double t_s) const {
  return std::visit([&](const auto& engine) { return engine.at(t_s); }, state_->engine);
}

std::optional<Tracker::Smoothed> Tracker::smoothed(double lag_s) const {
  return std::visit([&](const auto& engine) { return engine.smoothed(lag_s); }, state_->engine);
}

std::optional<Eigen::Vector3d> nearest_to_rays(const WorldRay& a, const WorldRay& b) {
  const Eigen::Vector3d& along_a = a.direction_in_world;
  const Eigen::Vector3d& along_b = b.direction_in_world;
  const double cosine = along_a.dot(along_b), sine2 = along_a.cross(along_b).squaredNorm();
  constexpr double least_sine = 1e-3;
  if (!(sine2 > least_sine * least_sine)) return std::nullopt;
  const Eigen::Vector3d apart = b.origin_in_world - a.origin_in_world;
  const double s = (apart.dot(along_a) - cosine * apart.dot(along_b)) / sine2;
  const double t = (cosine * apart.dot(along_a) - apart.dot(along_b)) / sine2;
  return 0.5 * (a.origin_in_world + s * along_a + b.origin_in_world + t * along_b);
}

std::string_view method_name(TrackMethod method) {
  constexpr std::array<std::string_view, 5> names{"cv", "singer", "turn", "resting", "imm"};
  return names[static_cast<std::size_t>(method)];
}

std::string_view event_name(TrackEvent event) {
  constexpr std::array<std::string_view, 9> names{"",      "waiting", "start", "restart", "gated",
                                                  "depth", "outside", "late",  "one_head"};
  return names[static_cast<std::size_t>(event)];
}

}  // namespace alidade
