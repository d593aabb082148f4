#include "alidade/observe/checks/cause_columns.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/so3.h"
#include "alidade/observe/checks/eliminated_rotations.h"

namespace alidade {
namespace {

constexpr int max_lever_points = 16, max_across_points = 8;
constexpr int num_waves = 6;  // half waves over the log: more of them leave too little to estimate the points from
constexpr double usual_wave = 0.005;
constexpr double usual_k = 0.3, usual_p = 0.01, usual_mount_rad = 0.2, usual_delay_s = 0.1, usual_shutter_s = 0.03,
                 usual_zoom_per_s = 0.01, usual_parallax_rad = 0.05, usual_step_rad = 0.02;

ObserveNuisances without_rotation(ObserveNuisances nuisances) {
  nuisances.rotation = false;
  return nuisances;
}

ObserveNuisances with_rotation(ObserveNuisances nuisances) {
  nuisances.mount = nuisances.delay = nuisances.rotation = true;
  return nuisances;
}

/// Variance of the measured rates [rad²/s²], if they are treated as noisy; otherwise 0.
double rate_variance(const Adjustment& reference) {
  const BundleSolution& solution = reference.solution;
  const auto& frames = reference.bundle.frames;
  double sum = 0.0, count = 0.0;
  for (std::size_t k = 1; solution.rotations_walk && k < solution.rotation_information.size(); ++k) {
    const double seconds2 = frames[k].dt_s * (frames[k].t_s - frames[k - 1].t_s);
    if (!(seconds2 > 0.0)) continue;
    sum += 1.0 / (solution.rotation_information[k] * seconds2);
    count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

/// Whether a rate is so noisy that its scale cannot be tested: the noise alone would give a scale error of −1, and
/// signal and noise together one of their ratio (errors in variables).
bool is_mostly_noise(const RotationLog& log, const RotationError& error, double variance) {
  constexpr double max_share = 1e-3;  // of the mean square of the rate
  if (error.cause != "scale of the rates" || variance == 0.0) return false;
  const int axis = error.member.back() - 'x';
  double squares = 0.0;
  for (const RotationRow& row : log.rows) squares += row.rate_rad_per_s[axis] * row.rate_rad_per_s[axis];
  return !(variance * static_cast<double>(log.rows.size()) < max_share * squares);
}

std::vector<RotationError> errors_but(const RotationLog& log, const Adjustment& reference,
                                      const std::vector<std::string>& estimated) {
  std::vector<RotationError> errors = rotation_errors(log.source, log.has_roll_rate);
  const double variance = rate_variance(reference);
  std::erase_if(errors, [&](const RotationError& error) { return is_mostly_noise(log, error, variance); });
  std::erase_if(errors, [&](const RotationError& error) {
    return std::find(estimated.begin(), estimated.end(), error.cause) != estimated.end();
  });
  return errors;
}

}  // namespace

CauseColumns::CauseColumns(const RotationLog& log, const Adjustment& reference, const CauseConfig& config)
    : reference_(reference),
      base_(without_rotation(config.nuisances)),
      wide_(with_rotation(config.nuisances)),
      height_(config.height),
      patterns_(turn_patterns(log, errors_but(log, reference, config.errors), config.max_gap_s)),
      lever_column_(reference.bundle.points.size(), -1),
      across_column_(reference.bundle.points.size(), -1),
      steps_s_(config.steps_s) {
  for (const RotationFrame& frame : reference.bundle.frames) {
    const auto row = std::lower_bound(log.rows.begin(), log.rows.end(), frame.t_s - 1e-9,
                                      [](const RotationRow& r, double t_s) { return r.t_s < t_s; });
    row_of_frame_.push_back(
        std::min(static_cast<std::size_t>(row - log.rows.begin()), std::max<std::size_t>(log.rows.size(), 1) - 1));
  }
  add_lens();
  const bool is_measured = log.source != RotationSource::none;
  if (!config.nuisances.mount && is_measured) {
    first_mount_ = size();
    for (const char* member : {"about x", "about y", "about z"}) add("mount", member, usual_mount_rad, "rad");
  }
  if (!config.nuisances.delay && is_measured) {
    first_delay_ = size();
    add("delay", "delay", usual_delay_s, "s");
  }
  if (!config.nuisances.shutter) {
    shutter_ = size();
    add("rolling shutter", "from top to bottom", usual_shutter_s, "s");
  }
  if (!config.nuisances.drift) drift_ = size();
  if (drift_ >= 0) add("focal length that drifts", "f'/f", usual_zoom_per_s, "1/s");
  add_zoom();
  if (!config.nuisances.lever) add_lever();
  if (is_measured && !has_rotations(reference.solution)) add_steps();
  first_pattern_ = size();
  for (const TurnPattern& pattern : patterns_) {
    add(pattern.error.cause, pattern.error.member, pattern.error.ordinary, pattern.error.unit);
  }
}

void CauseColumns::add(const std::string& group, const std::string& member, double ordinary, const std::string& unit) {
  auto at = std::find_if(groups_.begin(), groups_.end(), [&](const Group& each) { return each.name == group; });
  if (at == groups_.end()) at = groups_.insert(groups_.end(), {group, {}});
  at->columns.push_back(size());
  columns_.push_back({member, unit, ordinary});
}

void CauseColumns::add_lens() {
  first_k1_ = size();
  static constexpr const char* names[] = {"k1", "k2", "k3", "p1", "p2"};
  for (const char* name : names) columns_.push_back({name, "", name[0] == 'k' ? usual_k : usual_p});
  const bool is_free[] = {base_.k1 >= 0, base_.k2 >= 0, base_.k3 >= 0, base_.tangential >= 0, base_.tangential >= 0};
  // Each coefficient alone, the radial ones together, then all; those already estimated are omitted.
  constexpr std::pair<int, int> ranges[] = {{0, 1}, {1, 2}, {2, 3}, {3, 5}, {0, 2}, {0, 3}, {0, 5}};
  for (const auto& [from, until] : ranges) {
    Group group;
    for (int i = from; i < until; ++i) {
      if (is_free[i]) continue;
      group.name += (group.name.empty() ? "" : ",") + std::string(names[i]);
      group.columns.push_back(first_k1_ + i);
    }
    const bool is_new =
        std::none_of(groups_.begin(), groups_.end(), [&](const Group& each) { return each.name == group.name; });
    if (!group.columns.empty() && is_new) groups_.push_back(group);
  }
}

/// A focal length that varies: cosines of 1 to `num_waves` half periods over the log.
void CauseColumns::add_zoom() {
  first_zoom_ = size();
  for (int wave = 1; wave <= num_waves; ++wave) {
    add("focal length that varies", "in " + std::to_string(wave) + (wave == 1 ? " half wave" : " half waves"),
        usual_wave);
  }
}

/// Each candidate instant is a separate cause: a rotation about three axes [rad] from that instant on.
void CauseColumns::add_steps() {
  first_step_ = size();
  for (const double from_s : steps_s_) {
    groups_.push_back({step_cause, {size(), size() + 1, size() + 2}, from_s});
    for (const char* member : {"about x", "about y", "about z"}) columns_.push_back({member, "rad", usual_step_rad});
  }
}

void CauseColumns::add_lever() {
  first_lever_ = size();
  for (const char* member : {"x over distance", "y over distance", "z over distance"}) {
    add("lever", member, usual_parallax_rad, "rad");
  }
  std::vector<int> times(lever_column_.size(), 0);
  for (const BundleObservation& seen : reference_.bundle.observations) ++times[static_cast<std::size_t>(seen.point)];
  std::vector<int> order(times.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return times[static_cast<std::size_t>(a)] > times[static_cast<std::size_t>(b)];
  });
  // The most observed point carries the common parallax: only the others' deviations from it can be separated.
  for (std::size_t i = 1; i < order.size() && i <= max_lever_points; ++i) {
    lever_column_[static_cast<std::size_t>(order[i])] = size();
    add("lever", "z over distance, a point's own", usual_parallax_rad, "rad");
  }
  // Across the view, a parallax shared by all points is equivalent to a shift of the principal point.
  groups_.push_back({"lever across the view", {first_lever_, first_lever_ + 1}});
  for (std::size_t i = 1; i < order.size() && i <= max_across_points; ++i) {
    across_column_[static_cast<std::size_t>(order[i])] = size();
    add("lever across the view", "x over distance, a point's own", usual_parallax_rad, "rad");
    add("lever across the view", "y over distance, a point's own", usual_parallax_rad, "rad");
  }
}

void CauseColumns::begin_frame(int frame) {
  frame_ = frame;
  const RotationFrame now = rotated_frame(reference_, frame);
  frame_time_s_ = now.t_s;
  const RotatingCamera& camera = reference_.solution.camera;
  view_.emplace(camera, now);
  const Eigen::Matrix3d cam_from_mount = camera.cam_from_mount.toRotationMatrix();
  mount_from_cam_ = cam_from_mount.transpose();
  // The log gives the rotation of the mount since the start; the camera was mounted on it then as it is now.
  const Eigen::Matrix3d mount_from_begin = now.cam_from_start.toRotationMatrix(), begin_from_start = mount_from_cam_;
  cam_from_start_ = cam_from_mount * mount_from_begin * begin_from_start;
}

void CauseColumns::fill_lens(const Eigen::Vector3d& in_cam, Eigen::Ref<Eigen::MatrixXd> out) const {
  const Eigen::Vector4d k = reference_.solution.camera.k_at(frame_time_s_);
  // The distorted point is linear in all five coefficients.
  const double x = in_cam.x() / in_cam.z(), y = in_cam.y() / in_cam.z(), r2 = x * x + y * y;
  const Eigen::Vector2d radial(k[0] * x * r2, k[1] * y * r2);
  out.col(first_k1_) = radial;
  out.col(first_k1_ + 1) = radial * r2;
  out.col(first_k1_ + 2) = radial * r2 * r2;
  out.col(first_k1_ + 3) = Eigen::Vector2d(k[0] * 2.0 * x * y, k[1] * (r2 + 2.0 * y * y));
  out.col(first_k1_ + 4) = Eigen::Vector2d(k[0] * (r2 + 2.0 * x * x), k[1] * 2.0 * x * y);
}

bool CauseColumns::at(const BundleObservation& seen, RotationPrediction& p, Eigen::Ref<Eigen::MatrixXd> by_causes) {
  const auto point = static_cast<std::size_t>(seen.point);
  const BearingPoint& bearing = reference_.solution.points[point];
  RotationPrediction& wide = wide_prediction_;
  if (!view_->predict(bearing, base_, p) || !view_->predict(bearing, wide_, wide)) return false;
  by_causes.setZero();
  const Eigen::Vector3d in_cam = view_->point_in_cam(bearing);
  fill_lens(in_cam, by_causes);
  const Eigen::Matrix<double, 2, 3> by_rotation = this->by_rotation();
  if (first_mount_ >= 0) by_causes.middleCols<3>(first_mount_) = wide.J_px_common.middleCols<3>(wide_.mount);
  if (first_delay_ >= 0) by_causes.col(first_delay_) = wide.J_px_common.col(wide_.delay);
  if (shutter_ >= 0) by_causes.col(shutter_) = wide.J_px_common.col(wide_.delay) * (seen.px.y() / height_);
  for (std::size_t i = 0; first_step_ >= 0 && i < steps_s_.size(); ++i)
    if (frame_time_s_ >= steps_s_[i]) by_causes.middleCols<3>(first_step_ + 3 * static_cast<int>(i)) = by_rotation;
  const auto& frames = reference_.bundle.frames;
  const double mid_s = 0.5 * (frames.front().t_s + frames.back().t_s);
  if (drift_ >= 0)
    by_causes.col(drift_) =
        (frames[static_cast<std::size_t>(frame_)].t_s - mid_s) * (p.px - reference_.solution.camera.k.tail<2>());
  const double elapsed = frames[static_cast<std::size_t>(frame_)].t_s - frames.front().t_s;
  const double phase = std::numbers::pi * elapsed / std::max(frames.back().t_s - frames.front().t_s, 1e-9);
  for (int wave = 0; wave < num_waves; ++wave) {
    by_causes.col(first_zoom_ + wave) = std::cos((wave + 1) * phase) * (p.px - reference_.solution.camera.k.tail<2>());
  }
  if (first_lever_ >= 0) {
    // A shift v of the ray moves the pixel like the rotation ray × v / |ray|².
    const Eigen::Vector3d turned = mount_from_cam_ * in_cam;
    const Eigen::Matrix3d shift = mount_from_cam_ * (cam_from_start_ - Eigen::Matrix3d::Identity());
    const Eigen::Matrix<double, 2, 3> by_lever = by_rotation * (cross_matrix(turned) * shift) / in_cam.squaredNorm();
    by_causes.middleCols<3>(first_lever_) = by_lever;
    if (lever_column_[point] >= 0) by_causes.col(lever_column_[point]) = by_lever.col(2);
    if (across_column_[point] >= 0) by_causes.middleCols<2>(across_column_[point]) = by_lever.leftCols<2>();
  }
  const std::size_t row = row_of_frame_[static_cast<std::size_t>(frame_)];
  for (std::size_t i = 0; i < patterns_.size(); ++i) {
    by_causes.col(first_pattern_ + static_cast<int>(i)) = by_rotation * patterns_[i].turn_rad[row];
  }
  return true;
}

}  // namespace alidade
