#include "alidade/track/tracker.h"

#include <array>
#include <utility>
#include <variant>

#include "alidade/track/considered_filter.h"
#include "alidade/track/target_filter.h"
#include "alidade/track/track_engine.h"

namespace alidade {
namespace {

/// Engines for a single motion model: errors of the heads zero, considered, or estimated.
template <class Model>
using Exact = detail::TrackEngine<ModelFilter<Model>>;
template <class Model>
using Counting = detail::TrackEngine<ConsideredFilter<Model>>;
template <class Model>
using Learning = detail::TrackEngine<ConsideredFilter<Model, LearnedErrors>>;
using Engine =
    std::variant<Exact<ConstantVelocity>, Exact<Singer>, Exact<CoordinatedTurn>, Exact<MeanReverting>,
                 detail::TrackEngine<InteractingFilter>, Counting<ConstantVelocity>, Counting<Singer>,
                 Counting<CoordinatedTurn>, Counting<MeanReverting>, detail::TrackEngine<ConsideredInteracting>,
                 Exact<Ballistic>, Counting<Ballistic>, Learning<Ballistic>, Learning<ConstantVelocity>,
                 Learning<Singer>, Learning<CoordinatedTurn>, Learning<MeanReverting>>;

constexpr double share_of_acceleration_beside_turning = 0.3, share_while_quiet = 0.15;
constexpr double start_sigma_turn_rad_s = 1.0;

template <class Model>
Engine engine_of(std::vector<RigHead> heads, const TrackerConfig& config, const Model& motion, double sigma_rest) {
  const int num = config.errors.num();
  if (num == 0) return Exact<Model>(std::move(heads), config, {motion, sigma_rest});
  if (config.learn_errors) return Learning<Model>(std::move(heads), config, {motion, sigma_rest, num});
  return Counting<Model>(std::move(heads), config, {motion, sigma_rest, num});
}

Engine engine_for(std::vector<RigHead> heads, const TrackerConfig& config) {
  const double sigma_a = config.sigma_a_m_s2;
  const Singer singer{sigma_a, config.singer_tau_s};
  switch (config.method) {
    case TargetMotion::singer:
      return engine_of(std::move(heads), config, singer, sigma_a);
    case TargetMotion::turn:
      return engine_of(std::move(heads), config, CoordinatedTurn{share_of_acceleration_beside_turning * sigma_a},
                       start_sigma_turn_rad_s);
    case TargetMotion::resting:
      return engine_of(std::move(heads), config, MeanReverting{config.resting_sigma_v_m_s, config.resting_tau_s}, 1.0);
    case TargetMotion::imm: {
      const double sigma_quiet = share_while_quiet * sigma_a;
      const InteractingModels models{ConstantVelocity{sigma_quiet}, singer,
                                     Ballistic{sigma_quiet, config.gravity_m_s2}};
      if (config.errors.num() == 0) return detail::TrackEngine<InteractingFilter>(std::move(heads), config, models);
      return detail::TrackEngine<ConsideredInteracting>(std::move(heads), config, {models, config.errors.num()});
    }
    case TargetMotion::ballistic:
      return engine_of(std::move(heads), config, Ballistic{sigma_a, config.gravity_m_s2}, 1.0);
    case TargetMotion::cv:
      break;
  }
  return engine_of(std::move(heads), config, ConstantVelocity{sigma_a}, 1.0);
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

TrackStep Tracker::take(const TargetObservation& observation) {
  return std::visit([&](auto& engine) { return engine.take(observation); }, state_->engine);
}

std::optional<Belief<6>> Tracker::at(double t_s) const {
  return std::visit([&](const auto& engine) { return engine.at(t_s); }, state_->engine);
}

std::optional<Tracker::Smoothed> Tracker::smoothed(double lag_s) const {
  return std::visit([&](const auto& engine) { return engine.smoothed(lag_s); }, state_->engine);
}

std::optional<Tracker::Learned> Tracker::learned() const {
  return std::visit([&](const auto& engine) { return engine.learned(); }, state_->engine);
}

std::optional<Eigen::Vector3d> nearest_to_rays(const WorldRay& a, const WorldRay& b) {
  const Eigen::Vector3d& along_a = a.direction_in_world;
  const Eigen::Vector3d& along_b = b.direction_in_world;
  const double cosine = along_a.dot(along_b), sine2 = along_a.cross(along_b).squaredNorm();
  constexpr double min_sine = 1e-3;
  if (!(sine2 > min_sine * min_sine)) return std::nullopt;
  const Eigen::Vector3d apart = b.origin_in_world - a.origin_in_world;
  const double s = (apart.dot(along_a) - cosine * apart.dot(along_b)) / sine2;
  const double t = (cosine * apart.dot(along_a) - apart.dot(along_b)) / sine2;
  return 0.5 * (a.origin_in_world + s * along_a + b.origin_in_world + t * along_b);
}

std::string_view motion_name(TargetMotion method) {
  constexpr std::array<std::string_view, 6> names{"cv", "singer", "turn", "resting", "imm", "ballistic"};
  return names[static_cast<std::size_t>(method)];
}

std::string_view event_name(TrackEvent event) {
  constexpr std::array<std::string_view, 10> names{"",      "waiting", "start", "restart",  "gated",
                                                   "depth", "outside", "late",  "one_head", "frozen"};
  return names[static_cast<std::size_t>(event)];
}

}  // namespace alidade
