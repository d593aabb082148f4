#include <Eigen/LU>
#include <algorithm>
#include <array>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/known_pose.h"
#include "alidade/localize/observation_localizer.h"
#include "alidade/localize/path/path_resection.h"

// Restarts: when the target contradicts the path, and where a new one starts.
namespace alidade {

/// χ² of six components.
double ObservationLocalizer::contradiction_of(const StartHypothesis& from) const {
  const LocalizationFilter& now = engine_.best();
  const Eigen::Matrix<double, 6, 6> cov =
      now.motion_covariance().topLeftCorner<6, 6>() + from.cov.topLeftCorner<6, 6>();
  return squared_mahalanobis(pose_difference(from.motion.world_from_cam, now.motion().world_from_cam), cov);
}

constexpr double max_contradiction = 22.5;  // χ² of six components: 99.9 %

/// Poses from the target, if they contradict the path. Empty: they do not, or its observations fit no
/// pose.
std::vector<StartHypothesis> ObservationLocalizer::elsewhere(const ObservationFrame& frame) {
  std::vector<StartHypothesis> from =
      poses_from_known(engine_.camera(), frame.observations, config_.target.points, engine_.pose_config());
  if (from.empty()) return from;
  const auto agrees = [&](const StartHypothesis& each) { return contradiction_of(each) < max_contradiction; };
  if (std::ranges::any_of(from, agrees)) {
    from.clear();
    elsewhere_.clear();
  }
  return from;
}

/// Number of the target's observations that a pose explains.
int ObservationLocalizer::num_explained(const ObservationFrame& frame, const Rigid3& world_from_cam) const {
  const double gate_px2 = 4.0 * config_.filter.gate * config_.filter.sigma_px * config_.filter.sigma_px;
  int num = 0;
  for (const FeatureObservation& observation : frame.observations) {
    const auto known = std::ranges::find(config_.target.points, observation.id, &KnownPoint::id);
    if (known == config_.target.points.end()) continue;
    const auto px = project(engine_.camera(), world_from_cam.inverse() * known->point_in_world);
    num += px && (*px - observation.px).squaredNorm() < gate_px2 ? 1 : 0;
  }
  return num;
}

/// Whether a pose from the target that contradicts the path is no coincidence: hardly any of the target's observations
/// so far were mismatches, enough of them agree on it, or an earlier frame gave the same correction of the path. Two
/// earlier frames, if there is only some doubt.
bool ObservationLocalizer::is_no_chance(const ObservationFrame& frame, std::span<const StartHypothesis> from,
                                        Doubt doubt) {
  constexpr int enough = 6;
  constexpr double few_mismatches = 0.15;
  const bool has_mismatches = share(num_known_gated_, num_known_) > few_mismatches;
  const std::size_t num_before = elsewhere_.add(from, engine_.best().motion().world_from_cam, num_taken_);
  if (doubt == Doubt::some && num_before < 2) return false;
  return !has_mismatches || num_before > 0 || num_explained(frame, from.front().motion.world_from_cam) >= enough;
}

/// Removes all points except the target's.
void ObservationLocalizer::drop_map() {
  std::vector<long> unknown;
  for (const Feature& feature : engine_.best().features())
    if (!feature.is_known) unknown.push_back(feature.id);
  for (const long id : unknown) engine_.filters().remove(id);
  points_.forget_gone();
}

/// Restarts from the target, if it gives another pose. Mismatches may look like another pose: unless the observations
/// that fit contradict each other, it must explain at least two more of the target's, and with only some doubt three
/// frames must agree. The map of points that led there is dropped.
bool ObservationLocalizer::restart(const ObservationFrame& frame, Doubt doubt) {
  constexpr int min_more = 2;
  std::vector<StartHypothesis> from = doubt == Doubt::none ? std::vector<StartHypothesis>{} : elsewhere(frame);
  if (from.empty()) return false;
  const Rigid3& now = engine_.best().motion().world_from_cam;
  const int num_more = num_explained(frame, from.front().motion.world_from_cam) - num_explained(frame, now);
  if (doubt != Doubt::strong && num_more < min_more) return false;
  if (!is_no_chance(frame, from, doubt)) return false;
  drop_map();
  engine_.filters().restart(only_where(from));
  record_.begin(num_taken_);
  engine_.forget_doubt();
  elsewhere_.clear();
  engine_.count_restart();
  return true;
}

/// Gives up a path without external reference, and its map, if observations contradict it; a new one starts at its end.
/// Earlier frames are localised in the new map (observation_record.h).
bool ObservationLocalizer::begin_again(Doubt doubt) {
  constexpr std::size_t enough_tried = 10, young = 200;  // frames; a path that was right for long is kept
  const std::size_t age = num_taken_ - record_.begun();
  if (!is_free() || (doubt != Doubt::strong && doubt != Doubt::many) || age < enough_tried || age > young) return false;
  StartHypothesis from = *engine_.start_without_target();
  from.motion.world_from_cam = engine_.best().motion().world_from_cam;
  drop_map();
  engine_.filters().restart({{from}});
  record_.begin(num_taken_);
  engine_.forget_doubt();
  engine_.count_restart();
  return true;
}

/// A point whose position a single observation hardly changes: one of the target, or a converged one. New ones adapt to
/// whatever the known ones do not contradict.
bool ObservationLocalizer::is_firm(long id) const {
  const auto& features = engine_.best().features();
  const auto feature = std::ranges::find(features, id, &Feature::id);
  return feature != features.end() && (feature->is_known || feature->kind == FeatureKind::xyz);
}

/// Whether the pose found from there is still that pose, not the path's: the map pulls a chance pose back to the path.
bool ObservationLocalizer::is_there(const StartHypothesis& there, const Rigid3& found) const {
  const Eigen::Matrix<double, 6, 6> cov = there.cov.topLeftCorner<6, 6>();
  const auto away = [&](const Rigid3& from) { return squared_mahalanobis(pose_difference(found, from), cov); };
  return away(there.motion.world_from_cam) < away(engine_.best().motion().world_from_cam);
}

/// If half of the target is outside the gates of the path's prediction: the pose from the target, with the number of
/// observations that it would explain.
std::optional<ObservationLocalizer::OtherPlace> ObservationLocalizer::other_place(const ObservationFrame& frame) const {
  const LocalizationFilter& filter = engine_.best();
  std::size_t num_seen = 0, num_off = 0;
  for (const FeatureObservation& observation : frame.observations) {
    if (std::ranges::count(config_.target.points, observation.id, &KnownPoint::id) == 0) continue;
    ++num_seen;
    const auto expected = filter.expected(observation.id);
    const Eigen::Vector2d nu = expected ? (observation.px - expected->px).eval() : Eigen::Vector2d::Zero();
    num_off += !expected || nu.dot(expected->S.inverse() * nu) > config_.filter.gate ? 1 : 0;
  }
  if (num_seen < 4 || 2 * num_off < num_seen) return std::nullopt;
  OtherPlace other{poses_from_known(engine_.camera(), frame.observations, config_.target.points, engine_.pose_config()),
                   0, *engine_.bank()};
  if (other.from.empty()) return std::nullopt;
  std::vector<PlacedObservation> placed;
  for (const FeatureObservation& observation : frame.observations) {
    const auto place = filter.place(observation.id);
    if (!place || !is_firm(observation.id)) continue;
    const double sigma_px = observation.sigma_px > 0.0 ? observation.sigma_px : config_.filter.sigma_px;
    placed.push_back({observation.px, sigma_px, place->point_in_world, place->cov});
  }
  const std::array<Rigid3, 1> there{other.from.front().motion.world_from_cam};
  const auto found = resection(engine_.camera(), placed, there, config_.filter.gate);
  if (found && is_there(other.from.front(), found->world_from_cam)) other.num_explained = found->num_fit;
  return other;
}

/// Restarts there, if that explains more of the frame than the path did. If the motion contradicts it, the motion ends
/// there, and the map from it is dropped.
bool ObservationLocalizer::find_again(OtherPlace other, const ObservationFrame& frame,
                                      const ObservationsReport& report) {
  std::size_t num_explained = 0;
  for (std::size_t i = 0; i < frame.observations.size(); ++i)
    num_explained += report.outcomes[i] == ObservationOutcome::used && is_firm(frame.observations[i].id) ? 1 : 0;
  const std::size_t min_more = num_explained < min_observations ? 1 : 3;
  if (other.num_explained < num_explained + min_more) return false;
  const bool is_against = contradiction_of(other.from.front()) > max_contradiction;
  if (is_against && !is_no_chance(frame, other.from, Doubt::strong)) return false;
  engine_.filters() = std::move(other.before);
  if (contradiction_of(other.from.front()) > max_contradiction) {
    record_.jumped(num_taken_);
    drop_map();
  }
  engine_.filters().restart(only_where(std::move(other.from)));
  record_.begin(num_taken_);
  engine_.forget_doubt();
  elsewhere_.clear();
  engine_.count_restart();
  return true;
}

/// If the path is in doubt, restarts from the target or, without one, from the current pose.
void ObservationLocalizer::heed_doubt(const ObservationFrame& frame, std::optional<OtherPlace> other, Doubt doubt,
                                      const ObservationsReport& report, PathStep& step) {
  if ((other && find_again(std::move(*other), frame, report)) || restart(frame, doubt)) {
    const ObservationsReport again = engine_.update(frame.observations);
    engine_.fill(frame.observations, again, step);
    step.event = FrameEvent::restarted;
  }
  if (begin_again(doubt)) {
    step.event = FrameEvent::restarted;
    engine_.fill_pose(step);
    add_new(frame);
  }
}

}  // namespace alidade
