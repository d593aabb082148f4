#include "alidade/localize/observation_localizer.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/known_pose.h"
#include "alidade/localize/path/path_resection.h"

namespace alidade {
double ObservationLocalizer::period_s() const { return config_.period_s > 0.0 ? config_.period_s : gap_.s(); }

void ObservationLocalizer::keep_gap(double t_s) {
  if (num_taken_ > 0) gap_.add(t_s - t_s_);
  t_s_ = t_s;
}

/// Starts from the given start, or from the poses that the target gives; without both, the first camera defines the
/// world frame.
bool ObservationLocalizer::start(const ObservationFrame& frame) {
  std::vector<StartHypothesis> from;
  if (const auto start = engine_.start_without_target()) {
    if (!config_.start && frame.observations.size() < min_observations) return false;
    from = {*start};
  } else {
    from = poses_from_known(engine_.camera(), frame.observations, config_.target.points, engine_.pose_config());
    if (from.empty()) return false;
    from = only_where(std::move(from));
  }
  FilterBankConfig bank = config_.bank;
  // With many points and unknown scale, splitting the speed prior is pointless.
  constexpr std::size_t many = 30;
  if (is_free() && frame.observations.size() >= many) bank.splits = 1;
  engine_.begin(from, frame.t_s, bank);
  if (config_.target.points.size() > max_known_at_once) {
    for (const KnownPoint& point : config_.target.points) known_[point.id] = point;
    enter_known(frame);
  } else {
    for (const KnownPoint& point : config_.target.points)
      engine_.filters().add_known(point.id, point.point_in_world, point.sigma_m);
  }
  record_.begin(num_taken_);
  return true;
}

/// If there are too many known points, as from a map: enters those that are observed, in place of those not seen for
/// longest. The given position of a point is information to be used once: each time it returns its σ is doubled, so
/// that all of them together count at most 1 + 1/4 + 1/16 + … = 4/3 times.
void ObservationLocalizer::enter_known(const ObservationFrame& frame) {
  constexpr double again = 2.0;
  if (known_.empty()) return;
  std::vector<std::pair<std::size_t, long>> unseen;
  for (const Feature& feature : engine_.best().features())
    if (feature.is_known && std::ranges::count(frame.observations, feature.id, &FeatureObservation::id) == 0)
      unseen.emplace_back(points_.last_frame(feature.id), feature.id);
  std::ranges::sort(unseen, std::greater{});
  auto num = static_cast<std::size_t>(std::ranges::count_if(engine_.best().features(), &Feature::is_known));
  for (const FeatureObservation& observation : frame.observations) {
    const auto known = known_.find(observation.id);
    if (known == known_.end() || engine_.best().has(observation.id)) continue;
    if (num >= max_known_at_once && unseen.empty()) return;
    if (num >= max_known_at_once) {
      engine_.filters().remove(unseen.back().second);
      unseen.pop_back();
      --num;
    }
    engine_.filters().add_known(known->first, known->second.point_in_world, known->second.sigma_m);
    if (!engine_.best().has(known->first)) return;  // no room
    known->second.sigma_m *= again;
    points_.entered(known->first, num_taken_);
    ++num;
  }
}

/// Whether there is room for one more point.
bool ObservationLocalizer::has_room() const {
  const LocalizationFilter& filter = engine_.best();
  if (!filter.has_room(config_.new_points == NewPoints::xyz ? 3 : 6)) return false;
  const auto num_known = std::ranges::count_if(filter.features(), &Feature::is_known);
  return config_.max_points == 0 ||
         static_cast<std::ptrdiff_t>(filter.features().size()) - num_known < config_.max_points;
}

/// Value of a point that is not observed now: how much an observation of it would tell about the camera rather than the
/// point (pixel variance over that of its prediction), times the probability that it is seen again soon (it is in or
/// near the image, and was seen recently).
double ObservationLocalizer::value_of(const Feature& feature) const {
  const auto expected = engine_.best().expected(feature.id);
  if (!expected) return 0.0;
  const double information = config_.filter.sigma_px * config_.filter.sigma_px / std::sqrt(expected->S.determinant());
  const Eigen::Array2d size(engine_.camera().width_px, engine_.camera().height_px), px = expected->px;
  const double outside = std::max({0.0, (-px / size).maxCoeff(), (px / size - 1.0).maxCoeff()});
  constexpr double near_share = 0.25, half_life = 30.0;  // of the image size; frames
  const double age = static_cast<double>(num_taken_ - points_.last_frame(feature.id));
  return information * std::exp(-outside / near_share) * std::exp2(-age / half_life);
}

/// The points that may leave, least useful first.
std::vector<long> ObservationLocalizer::least_useful(const ObservationFrame& frame) const {
  constexpr double useful = 0.5;
  std::vector<std::pair<double, long>> worth;
  for (const Feature& feature : engine_.best().features()) {
    const bool is_seen = std::ranges::count(frame.observations, feature.id, &FeatureObservation::id) > 0;
    if (feature.is_known || is_seen) continue;
    if (const double value = value_of(feature); value < useful) worth.emplace_back(value, feature.id);
  }
  std::ranges::sort(worth);
  std::vector<long> ids;
  for (const auto& [value, id] : worth) ids.push_back(id);
  return ids;
}

void ObservationLocalizer::let_go(long id) {
  const LocalizationFilter& filter = engine_.best();
  const auto place = filter.place(id);
  const auto feature = std::ranges::find(filter.features(), id, &Feature::id);
  points_.keep({{id, place->point_in_world, place->cov, false, 0}, is_settled(*feature, filter, config_)});
  engine_.filters().remove(id);
  ++num_left_;
}

/// Adds observed points. If the filter is full, points of little use make room; they keep their number when they
/// return.
void ObservationLocalizer::add_new(const ObservationFrame& frame) {
  std::optional<std::vector<long>> leaving;
  std::size_t num_gone = 0;
  for (const FeatureObservation& observation : frame.observations) {
    if (engine_.best().has(observation.id) || known_.contains(observation.id)) continue;
    const auto prior = points_.prior_of(observation, engine_.best());
    if (!prior) continue;
    if (!leaving && !has_room()) leaving = least_useful(frame);
    while (!has_room() && num_gone < leaving->size()) let_go((*leaving)[num_gone++]);
    if (!has_room()) continue;
    const FeatureKind kind = config_.new_points == NewPoints::xyz ? FeatureKind::xyz : FeatureKind::inverse_depth;
    if (!engine_.filters().add(observation.id, observation.px, *prior, kind)) continue;
    record_.entered(num_taken_, observation.id, *prior, points_.is_gone(observation.id));
    points_.entered(observation.id, num_taken_);
  }
}

/// Removes points that were gated several times in a row; they may enter again.
void ObservationLocalizer::drop_strangers(const ObservationFrame& frame, const ObservationsReport& report) {
  for (std::size_t i = 0; i < frame.observations.size(); ++i) {
    if (!points_.is_stranger(frame.observations[i].id, report.outcomes[i], num_taken_)) continue;
    engine_.filters().remove(frame.observations[i].id);
    record_.left(frame.observations[i].id);
  }
}

/// Whether the predicted pixels of most target points are too uncertain: an update would find a pose that explains
/// them, but not always the right one.
bool ObservationLocalizer::is_vague(const ObservationFrame& frame) const {
  constexpr double vague_share = 0.13;  // of the image width
  const double vague_px = vague_share * engine_.camera().width_px;
  std::size_t num_seen = 0, num_vague = 0;
  for (const KnownPoint& point : config_.target.points) {
    if (std::ranges::count(frame.observations, point.id, &FeatureObservation::id) == 0) continue;
    ++num_seen;
    const auto expected = engine_.best().expected(point.id);
    num_vague += !expected || expected->S.trace() > vague_px * vague_px ? 1 : 0;
  }
  return num_seen >= 4 && 2 * num_vague > num_seen;
}

/// Restarts at the poses from the target, weighted by the motion prior.
void ObservationLocalizer::place_by_target(const ObservationFrame& frame) {
  std::vector<StartHypothesis> from =
      poses_from_known(engine_.camera(), frame.observations, config_.target.points, engine_.pose_config());
  std::vector<double> costs;
  for (const StartHypothesis& each : from) costs.push_back(each.cost + contradiction_of(each));
  from = only_where(std::move(from));
  for (std::size_t i = 0; i < from.size(); ++i) from[i].cost = costs[i];
  if (!from.empty()) engine_.filters().restart(from);
}

/// Replaces the points' numbers by the map's.
ObservationFrame ObservationLocalizer::numbered(ObservationFrame frame) {
  const auto has_left = [&](long id) { return points_.is_gone(id) && !engine_.best().has(id); };
  for (FeatureObservation& observation : frame.observations)
    observation.id = episodes_.id_of(observation.id, num_taken_, has_left);
  return frame;
}

PathStep ObservationLocalizer::take(const ObservationFrame& given) {
  keep_gap(given.t_s);
  ObservationFrame frame = numbered(given);
  bool is_repeated = shows_last(frame) && engine_.has_begun();
  if (is_repeated) engine_.predict_to(frame.t_s, period_s());
  is_repeated = is_repeated && should_move(frame);
  PathStep step = is_repeated ? passed_over(frame) : taken(frame);
  if (is_repeated) frame.observations.clear();
  ++num_taken_;
  if (config_.smooths) frames_.add(std::move(frame));
  return step;
}

/// Predicts the camera to a frame before its observations are used; the first frames start the path.
FrameEvent ObservationLocalizer::come_to(const ObservationFrame& frame) {
  if (!engine_.has_begun()) return start(frame) ? FrameEvent::started : FrameEvent::waiting;
  engine_.predict_to(frame.t_s, period_s());
  enter_known(frame);
  if (config_.restarts && is_vague(frame)) place_by_target(frame);
  return FrameEvent::tracked;
}

PathStep ObservationLocalizer::taken(const ObservationFrame& frame) {
  PathStep step;
  step.frame = frame.frame;
  step.t_s = frame.t_s;
  step.num_seen = frame.observations.size();
  step.event = come_to(frame);
  if (step.event == FrameEvent::waiting) return step;
  const bool may_be_elsewhere = config_.restarts && step.event == FrameEvent::tracked;
  std::optional<OtherPlace> other;
  if (may_be_elsewhere) other = other_place(frame);
  const ObservationsReport report = engine_.update(frame.observations);
  engine_.fill(frame.observations, report, step);
  engine_.keep_residuals(frame.observations, report);
  if (may_be_elsewhere && !other) other = other_place(frame);
  if (step.event == FrameEvent::tracked && step.num_tracked < min_observations) step.event = FrameEvent::predicted;
  const Doubt doubt = engine_.doubt_after(step);
  drop_strangers(frame, report);
  if (config_.restarts) heed_doubt(frame, std::move(other), doubt, report, step);
  num_known_ += step.num_known;
  num_known_gated_ += step.num_known_gated;
  if (step.num_tracked >= min_observations || step.event == FrameEvent::started) add_new(frame);
  engine_.filters().convert_linear();
  engine_.keep_given();
  if (config_.inspect) config_.inspect(engine_.best());
  return step;
}

}  // namespace alidade
