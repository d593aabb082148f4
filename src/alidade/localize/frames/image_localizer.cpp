#include "alidade/localize/frames/image_localizer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/estimation/median.h"
#include "alidade/patches/corner_features.h"

namespace alidade {
namespace {

constexpr std::size_t min_tracked = 5;  // three points determine a pose; two more reveal a mistake
constexpr double min_share = 0.25;      // of the searched features: fewer may be chance
constexpr double prior_share = 0.5;     // relative σ of a new inverse depth: from half the depth to infinity

}  // namespace

LocalizationFilterConfig for_images(LocalizationFilterConfig config, double sigma_floor_px) {
  constexpr double few_doubtful = 0.1;  // so few the gates alone reject; a consensus costs as much as the update
  if (!(config.sigma_new_px > 0.0)) config.sigma_new_px = sigma_floor_px;
  // Many matches determine the first frames' poses: world rotation errors are admissible there, too, and must not
  // become asymmetric.
  config.max_rotation_rad = std::max(config.max_rotation_rad, 0.05);
  config.curvature_tolerance = std::min(config.curvature_tolerance, 0.001);
  config.consensus_above = std::max(config.consensus_above, few_doubtful);
  return config;
}

ImageLocalizer::ImageLocalizer(const Camera& camera, const LocalizeConfig& config)
    : engine_(camera, config), config_(config), kept_(static_cast<std::size_t>(config.max_smoothed)) {
  next_id_ = static_cast<long>(config.target.points.size());
  for (const KnownPoint& point : config.target.points) next_id_ = std::max(next_id_, point.id + 1);
  if (config.map) take_saved(*config.map);
}

void ImageLocalizer::forget(long id) {
  engine_.filters().remove(id);
  landmarks_.erase(id);
}

/// With tens of features the curved valley for which FilterBank splits speeds is gone after one frame; both poses stay.
void ImageLocalizer::begin_at(std::span<const StartHypothesis> starts) {
  FilterBankConfig bank = config_.bank;
  bank.splits = 1;
  engine_.begin(starts, t_s_, bank);
  record_.begin(num_taken_);
}

/// Empty without a target.
std::optional<SeenTarget> ImageLocalizer::seen_target(const cv::Mat& smoothed) const {
  if (config_.target.points.empty()) return std::nullopt;
  return find_target(smoothed, engine_.camera(), config_.target, engine_.pose_config());
}

/// Starts from the given start or from the target; without both, the first camera defines the world frame.
bool ImageLocalizer::start(const cv::Mat& smoothed) {
  if (config_.map) return start_in_map(smoothed);
  const std::optional<SeenTarget>& seen = target_now(smoothed);
  if (!seen && !config_.target.points.empty()) return false;
  if (seen && seen->num_alike > 1) {
    num_alike_ = std::max(num_alike_, seen->num_alike);
    return false;
  }
  if (const auto start = engine_.start_without_target())
    begin_at({{*start}});
  else
    begin_at(only_where(seen->starts));  // the same observations follow as a measurement, with the points' own σ
  if (seen) add_target(smoothed, *seen);
  add_new(smoothed);
  return seen || num_found_now_ >= min_tracked;
}

/// Later searches look for the corner's surroundings as found, not for the corner itself: the position of these in the
/// world is as uncertain as the corner's detection.
std::vector<KnownPoint> ImageLocalizer::given_points(const SeenTarget& seen) const {
  std::vector<KnownPoint> given = config_.target.points;
  for (KnownPoint& point : given) {
    const auto at = std::ranges::find(seen.observations, point.id, &FeatureObservation::id);
    if (at == seen.observations.end()) continue;
    const Rigid3& world_from_cam = seen.starts.front().motion.world_from_cam;
    const double distance_m = (world_from_cam.translation - point.point_in_world).norm();
    point.sigma_m = std::hypot(point.sigma_m, at->sigma_px * distance_m / params(engine_.camera().lens)[0]);
  }
  return given;
}

/// Adds its points to the map, with patches of their current surroundings to find them again.
void ImageLocalizer::add_target(const cv::Mat& smoothed, const SeenTarget& seen) {
  const std::vector<KnownPoint>& points = config_.target.points;
  given_ = given_points(seen);
  for (const KnownPoint& point : given_) engine_.filters().add_known(point.id, point.point_in_world, point.sigma_m);
  std::vector<FeatureObservation> observations = seen.observations;
  for (FeatureObservation& observation : observations) observation.sigma_px = config_.features.sigma_floor_px;
  const ObservationsReport report = engine_.update(observations);
  num_found_now_ = report.num_used;
  now_ = observations;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of the plane through the points
  for (std::size_t i = 2; i < points.size(); ++i)
    normal += (points[i - 1].point_in_world - points[0].point_in_world)
                  .cross(points[i].point_in_world - points[0].point_in_world);
  const Rigid3& world_from_cam = engine_.best().motion().world_from_cam;
  in_view_.clear();
  for (const FeatureObservation& observation : seen.observations) {
    const auto point = std::ranges::find(points, observation.id, &KnownPoint::id);
    in_view_.push_back(observation.px);
    auto landmark = new_landmark(observation.id, smoothed, engine_.camera(), world_from_cam, observation.px,
                                 point->point_in_world, normal.norm() > 0.0 ? std::optional(normal) : std::nullopt);
    if (!landmark) continue;
    landmark->is_known = true;
    landmark->last_found = frame_;
    landmark->first_step = num_taken_;
    landmarks_[observation.id] = *landmark;
  }
}

/// The period is the smallest gap so far: images may be missing.
void ImageLocalizer::predict_to(double t_s) {
  const double gap_s = t_s - t_s_;
  if (!(period_s_ > 0.0) || gap_s < period_s_) period_s_ = gap_s;
  engine_.predict_to(t_s, period_s());
  t_s_ = t_s;
}

std::vector<FeatureObservation> ImageLocalizer::look(const cv::Mat& smoothed, const Search& search) {
  const LocalizationFilter& filter = engine_.best();
  std::vector<FeatureObservation> observations;
  tried_.clear();
  in_view_.clear();
  constexpr double margin_px = PatchView::half_px + 2.0;
  const std::vector<FeatureObservation>* corners = corners_of_board(smoothed);
  for (const Feature& feature : filter.features()) {  // in order of age
    const auto at = landmarks_.find(feature.id);
    if (at == landmarks_.end()) continue;
    auto expected = filter.expected(feature.id);
    if (!expected || expected->px.minCoeff() < margin_px || expected->px.x() > smoothed.cols - 1 - margin_px ||
        expected->px.y() > smoothed.rows - 1 - margin_px)
      continue;
    if (!is_shown(expected->px)) continue;
    in_view_.push_back(expected->px);
    if (tried_.size() >= static_cast<std::size_t>(config_.features.max_tried)) continue;
    Landmark& landmark = at->second;
    const auto warp =
        here_from_first(landmark, engine_.camera(), filter.motion().world_from_cam, place_of(feature).point_in_world);
    const auto view = warp ? landmark.patch.seen_through(*warp) : std::nullopt;
    if (!view) continue;
    expected->S.diagonal().array() += search.extra_sigma_px * search.extra_sigma_px;
    const Eigen::Vector2d offset_px = *warp * landmark.offset_px;
    tried_.push_back({feature.id, expected->px, expected->S, {}, false});
    if (corners && landmark.is_known && !landmark.is_saved) {
      take_corner(*corners, observations);
      continue;
    }
    const auto match =
        find_patch(smoothed, *view, expected->px - offset_px, expected->S, {3.0, search.min_correlation});
    if (!match) continue;
    tried_.back().found_px = match->px + offset_px;
    in_view_.back() = match->px + offset_px;
    observations.push_back(
        {feature.id, match->px + offset_px, std::hypot(match->sigma_px, config_.features.sigma_floor_px)});
  }
  return observations;
}

bool ImageLocalizer::is_found(std::size_t num_found) const {
  return num_found >= min_tracked && static_cast<double>(num_found) >= min_share * static_cast<double>(tried_.size());
}

void ImageLocalizer::count(std::span<const FeatureObservation> observations, const ObservationsReport& report) {
  for (const ObservationTried& tried : tried_) ++landmarks_.at(tried.id).num_tried;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (report.outcomes[i] != ObservationOutcome::used) continue;
    Landmark& landmark = landmarks_.at(observations[i].id);
    ++landmark.num_found;
    landmark.last_found = frame_;
    landmark.last_px = observations[i].px;
    const auto tried = std::ranges::find(tried_, observations[i].id, &ObservationTried::id);
    if (tried != tried_.end()) tried->is_used = true;
  }
}

void ImageLocalizer::drop_bad() {
  constexpr int min_tries = 8;
  std::vector<long> bad;
  for (const auto& [id, landmark] : landmarks_) {
    if ((landmark.is_known && !landmark.is_saved) || landmark.num_tried < min_tries) continue;
    if (landmark.num_found < config_.features.min_found_share * landmark.num_tried) bad.push_back(id);
  }
  std::ranges::sort(bad);
  for (const long id : bad) {
    forget(id);
    record_.left(id);
    saved_.erase(id);
  }
}

/// Median depth of the well-known points of the map.
double ImageLocalizer::usual_depth_m() const {
  const LocalizationFilter& filter = engine_.best();
  if (config_.depth_m) return *config_.depth_m;
  const Rigid3 cam_from_world = filter.motion().world_from_cam.inverse();
  std::vector<double> depths;
  for (const Feature& feature : filter.features()) {
    const double depth = (cam_from_world * place_of(feature).point_in_world).z();
    if (depth > 0.0 && feature.kind == FeatureKind::xyz) depths.push_back(depth);
  }
  if (depths.empty()) return 1.0;  // world of unknown scale: the first points are one unit away
  return median_of(std::move(depths));
}

/// If the map is full, removes the landmark that was not seen for the longest time.
bool ImageLocalizer::make_room() {
  if (landmarks_.size() < static_cast<std::size_t>(config_.features.max_features)) return true;
  const Landmark* oldest = nullptr;
  for (const auto& [id, landmark] : landmarks_) {
    if (landmark.is_known || landmark.last_found == frame_) continue;
    if (!oldest || landmark.last_found < oldest->last_found ||
        (landmark.last_found == oldest->last_found && id < oldest->id))
      oldest = &landmark;
  }
  if (!oldest) return false;
  let_go(oldest->id);
  return true;
}

void ImageLocalizer::add_new(const cv::Mat& smoothed) {
  const ImageFeatureConfig& features = config_.features;
  const auto min_found = static_cast<std::size_t>(features.min_found);
  if (num_found_now_ >= min_found) return;
  CornerFeatureConfig corners;
  corners.cell_px = features.cell_px > 0 ? features.cell_px : std::max(24, smoothed.cols / 10);
  corners.min_distance_px = 0.5 * corners.cell_px;
  const bool is_first = landmarks_.size() < min_tracked;
  std::size_t most =
      std::min(min_found - num_found_now_, is_first ? min_found : static_cast<std::size_t>(features.max_new));
  const double depth_m = usual_depth_m();
  for (const CornerFeature& corner : corners_in_empty_cells(smoothed, in_view_, corners)) {
    if (most == 0 || !make_room()) return;
    if (add_landmark(smoothed, corner.px.cast<double>(), depth_m)) --most;
  }
}

bool ImageLocalizer::add_landmark(const cv::Mat& smoothed, const Eigen::Vector2d& px, double depth_m) {
  const auto ray_in_cam = unproject(engine_.camera(), px);
  if (!ray_in_cam || !is_shown(px)) return false;
  constexpr double min_z = 0.2;  // at the edge of a wide lens a depth is no distance
  const double range_m = depth_m / std::max(ray_in_cam->z(), min_z);
  const Rigid3 world_from_cam = engine_.best().motion().world_from_cam;
  auto landmark =
      new_landmark(next_id_, smoothed, engine_.camera(), world_from_cam, px, world_from_cam * (range_m * *ray_in_cam));
  if (!landmark || !engine_.filters().add(next_id_, px, {range_m, prior_share, !config_.depth_m})) return false;
  landmark->last_found = frame_;
  landmark->last_px = px;
  landmark->first_step = num_taken_;
  record_.entered(num_taken_, next_id_, {range_m, prior_share}, false);
  now_.push_back({next_id_, px, config_.features.sigma_floor_px});
  landmarks_[next_id_++] = *landmark;
  ++num_found_now_;
  return true;
}

/// Tries a possible pose of the camera: a wide search, an update of the filter, and a second search that must find most
/// of the features where they are then predicted.
bool ImageLocalizer::try_from(const cv::Mat& smoothed, const StartHypothesis& from, PathStep& step) {
  engine_.filters().restart({{from}});
  enter_saved();
  const std::vector<FeatureObservation> observations = look(smoothed, {0.85, 0.0});
  if (!is_found(observations.size())) return false;
  const ObservationsReport report = engine_.update(observations);
  constexpr double max_nis = 3.0;
  if (!report.is_sound || !is_found(report.num_used) || report.nis_per_dof > max_nis) return false;
  PathStep found = step;
  engine_.fill(observations, report, found);
  const std::vector<FeatureObservation> again = look(smoothed, {config_.features.min_correlation, 0.0});
  constexpr double sure_share = 0.5;
  constexpr std::size_t sure_number = 8;
  if (again.size() < sure_number || static_cast<double>(again.size()) < sure_share * static_cast<double>(tried_.size()))
    return false;
  step = found;
  now_ = observations;
  return true;
}

/// If the observations of several images in a row contradict the path although they are found, restarts from the target
/// or a keyframe, if that explains this image.
bool ImageLocalizer::restart_in_doubt(const cv::Mat& smoothed, PathStep& step) {
  const Doubt doubt = config_.restarts ? engine_.doubt_after(step) : Doubt::none;
  if (doubt != Doubt::strong && doubt != Doubt::many) return false;
  engine_.forget_doubt();
  const FilterBank before = engine_.filters();
  if (find_back(smoothed, step)) return true;
  engine_.filters() = before;
  return false;
}

/// The poses of the keyframes most similar to the image.
std::vector<StartHypothesis> ImageLocalizer::likely_places(const cv::Mat& smoothed, double depth_m) const {
  std::vector<StartHypothesis> starts;
  constexpr double sigma_share = 0.15, sigma_rad = 0.08;  // of a keyframe's pose as a guess
  for (const Rigid3& world_from_cam : keyframes_.candidates(smoothed, engine_.camera(), 4)) {
    StartHypothesis start;
    start.motion.world_from_cam = world_from_cam;
    start.cov.diagonal().head<3>().setConstant(std::pow(sigma_share * depth_m, 2));
    start.cov.diagonal().segment<3>(3).setConstant(sigma_rad * sigma_rad);
    start.cov.diagonal().segment<3>(6).setConstant(std::pow(config_.sigma_speed_m_s, 2));
    start.cov.diagonal().tail<3>().setConstant(std::pow(config_.sigma_rate_rad_s, 2));
    starts.push_back(start);
  }
  return starts;
}

bool ImageLocalizer::find_back(const cv::Mat& smoothed, PathStep& step) {
  std::vector<StartHypothesis> starts = likely_places(smoothed, usual_depth_m());
  if (const auto& seen = target_now(smoothed)) starts.insert(starts.begin(), seen->starts.begin(), seen->starts.end());
  const FilterBank before = engine_.filters();
  for (const StartHypothesis& start : starts) {
    if (try_from(smoothed, start, step)) return true;
    engine_.filters() = before;
  }
  return false;
}

/// Processes an image after the first of the path.
void ImageLocalizer::take_next(const cv::Mat& smoothed, PathStep& step) {
  predict_to(step.t_s);
  if (is_repeated_ && should_move()) {  // a frozen stream: taken at another time
    ++num_repeated_;
    tried_.clear();
    step.event = FrameEvent::predicted;
    return;
  }
  enter_saved();
  std::vector<FeatureObservation> observations = look(smoothed, {config_.features.min_correlation, 0.0});
  if (config_.disturb) config_.disturb(step.frame, observations);
  step.num_seen = observations.size();
  step.event = FrameEvent::predicted;
  if (is_found(observations.size())) {
    const ObservationsReport report = engine_.update(observations);
    engine_.fill(observations, report, step);
    now_ = observations;
    count(observations, report);
    engine_.keep_residuals(observations, report);
    if (is_found(report.num_used)) step.event = FrameEvent::tracked;
  }
  if (step.event == FrameEvent::predicted ? find_back(smoothed, step) : restart_in_doubt(smoothed, step)) {
    step.event = FrameEvent::restarted;
    engine_.count_restart();
  }
  num_found_now_ = step.num_tracked;
  if (step.event == FrameEvent::predicted) return;
  drop_bad();
  engine_.filters().convert_linear();
  add_new(smoothed);
}

PathStep ImageLocalizer::take(const cv::Mat& grey, long frame, double t_s) {
  now_.clear();
  is_repeated_ = shows_last(grey);
  PathStep step = taken(grey, smoothed_for_search(grey), frame, t_s);
  ++num_taken_;
  if (config_.smooths) kept_.add({frame, t_s, now_});
  return step;
}

PathStep ImageLocalizer::taken(const cv::Mat& grey, const cv::Mat& smoothed, long frame, double t_s) {
  mask(grey, smoothed);
  seen_now_.reset();
  PathStep step;
  step.frame = frame_ = frame;
  step.t_s = t_s;
  if (engine_.has_begun()) {
    take_next(smoothed, step);
  } else {
    t_s_ = t_s;
    if (!start(smoothed)) {
      engine_.end();
      landmarks_.clear();
      record_ = {};
      now_.clear();
      return step;
    }
    step.event = FrameEvent::started;
    step.num_seen = step.num_tracked = landmarks_.size();
  }
  engine_.fill_pose(step);
  engine_.keep_given();
  if (step.event == FrameEvent::tracked) {
    const double depth_m = usual_depth_m();
    keyframes_.offer(grey, step.world_from_cam, config_.features.near_share * depth_m, config_.features.near_rad,
                     num_taken_);
    close_loop(smoothed, depth_m);
  }
  return step;
}

}  // namespace alidade
