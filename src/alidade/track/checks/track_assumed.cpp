#include "alidade/track/checks/track_assumed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/track/checks/time_steps.h"
#include "alidade/track/checks/unseen_errors.h"

namespace alidade {
namespace {

constexpr double ordinary_f = 0.003, ordinary_centre_px = 2.0, ordinary_scale = 0.005;
constexpr double ordinary_turn_rad = 0.0017453292519943295;  // 0.1°: accuracy of a mounting set by hand and eye
constexpr double ordinary_clock_s = 0.005;
constexpr std::array<const char*, 3> coordinates{"x_m", "y_m", "z_m"};

/// The step with the median distance of the target, and the heads' readings at about its time.
struct Median {
  const TrackStep* step = nullptr;
  std::vector<HeadReading> readings;
};

Median median_of_steps(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                       const TrackReport& report) {
  std::vector<std::pair<double, std::size_t>> by_range;
  const Eigen::Vector3d origin = heads[0].head.world_from_base.translation;
  for (std::size_t i = report.steps.size() / 10; i < report.steps.size(); ++i) {
    const TrackStep& step = report.steps[i];
    if (step.has_belief && step.accepted) by_range.emplace_back((step.belief.x.head<3>() - origin).norm(), i);
  }
  Median median;
  if (by_range.empty()) return median;
  const auto middle = by_range.begin() + static_cast<std::ptrdiff_t>(by_range.size() / 2);
  std::ranges::nth_element(by_range, middle);
  median.step = &report.steps[middle->second];
  median.readings = readings_at(observations, heads.size(), median.step->t_s);
  return median;
}

/// Collects the assumptions with their effects on the position of the target.
class Lister {
 public:
  Lister(const Rig& rig, const Median& median) : rig_(rig), median_(median) {
    if (median.step != nullptr)
      by_ = meeting_sensitivity(rig.heads, median.readings, median.step->belief.x.head<3>(),
                                median.step->belief.x.segment<3>(3));
  }
  std::vector<Assumption> assumed;

  /// `columns`: parameters of the head, each with its share of the error.
  void add(Assumption what, std::size_t head, const std::vector<std::pair<Eigen::Index, double>>& columns) {
    const double error = what.sigma.value_or(what.ordinary);
    if (head < by_.size() && by_[head].size() > 0) {
      Eigen::Vector3d moved = Eigen::Vector3d::Zero();
      for (const auto& [column, share] : columns) moved += error * share * by_[head].col(column);
      for (int i = 0; i < 3; ++i) {
        const double in_sigma = std::abs(moved[i]) / std::sqrt(median_.step->belief.P(i, i));
        if (!(in_sigma > what.moves)) continue;
        what.moves = in_sigma;
        what.moved = coordinates[static_cast<std::size_t>(i)];
        what.moved_by = moved[i];
      }
    }
    assumed.push_back(std::move(what));
  }

  void add_lens(std::size_t h) {
    const Camera& camera = rig_.heads[h].camera;
    const Eigen::VectorXd values = params(camera.lens);
    const bool is_given = camera.cov.rows() == values.size();
    const std::string name = name_of(h) + ".camera";
    const std::string remedy = "use camera files with their covariance (alidade calibrate writes it)";
    const auto sigma = [&](Eigen::Index k) -> std::optional<double> {
      if (!is_given) return std::nullopt;
      return std::sqrt(std::max(0.0, camera.cov(k, k)));
    };
    add({.name = name + ".fx",
         .value = values[0],
         .sigma = sigma(0),
         .ordinary = ordinary_f * values[0],
         .remedy = remedy},
        h, {{num_head_params, 1.0}, {num_head_params + 1, values[1] / values[0]}});
    for (const Eigen::Index k : {Eigen::Index{2}, Eigen::Index{3}})
      add({.name = name + (k == 2 ? ".cx" : ".cy"),
           .value = values[k],
           .sigma = sigma(k),
           .ordinary = ordinary_centre_px,
           .remedy = remedy},
          h, {{num_head_params + k, 1.0}});
  }

  /// The mounting of heads after the first relative to it, as in the rig file.
  void add_mounting(std::size_t h) {
    const Eigen::Index yaw = num_head_params * static_cast<Eigen::Index>(h) + 4;
    const bool is_given = rig_.cov.rows() > yaw;
    Assumption what{.name = name_of(h) + ".base_ry_rad",
                    .value = std::nan(""),
                    .ordinary = ordinary_turn_rad,
                    .remedy = "use a rig file with its covariance (alidade rig writes it)"};
    if (is_given) what.sigma = std::sqrt(std::max(0.0, rig_.cov(yaw, yaw)));
    add(std::move(what), h, {{4, 1.0}});
  }

  void add_scales(std::size_t h) {
    const bool is_exact = rig_.cov.size() > 0 && rig_.cov.isZero(0.0);
    const Encoder& encoder = rig_.heads[h].head.encoder;
    for (const int axis : {0, 1}) {
      const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h) + 17 + axis;
      const double own = h < rig_.encoder_errors.size() ? rig_.encoder_errors[h].sigma_scale : std::nan("");
      Assumption what{.name = name_of(h) + (axis == 0 ? ".pan_scale" : ".tilt_scale"),
                      .value = axis == 0 ? encoder.pan_scale : encoder.tilt_scale,
                      .ordinary = ordinary_scale,
                      .remedy = "have the scales estimated (alidade rig --scales), or write the encoder's sigma_scale"};
      if (rig_.cov.rows() > at && rig_.cov(at, at) > 0.0) what.sigma = std::sqrt(rig_.cov(at, at));
      if (!what.sigma && own >= 0.0) what.sigma = own;
      if (!what.sigma && is_exact) what.sigma = 0.0;
      add(std::move(what), h, {{17 + axis, 1.0}});
    }
  }

  void add_clock(std::size_t h, double sigma_clock_s) {
    Assumption what{
        .name = name_of(h) + ".clock_s", .value = 0.0, .ordinary = ordinary_clock_s, .remedy = "give --sigma-clock"};
    if (sigma_clock_s > 0.0) what.sigma = sigma_clock_s;
    const Eigen::Index column = h < by_.size() ? by_[h].cols() - 1 : 0;
    add(std::move(what), h, {{column, 1.0}});
  }

  [[nodiscard]] std::string name_of(std::size_t h) const { return "head" + std::to_string(rig_.heads[h].head.id); }

 private:
  const Rig& rig_;
  const Median& median_;
  std::vector<Eigen::MatrixXd> by_;
};

/// Displacement of the track with a third more acceleration: RMS over its steps, in σ of each.
double moved_by_motion(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                       const FollowConfig& config, const TrackReport& report) {
  constexpr std::size_t max_observations = 2000;
  TrackerConfig other = config.tracker;
  other.sigma_a_m_s2 = 1.333 * report.sigma_a_m_s2;
  Tracker tracker({heads.begin(), heads.end()}, other);
  double sum = 0.0, num = 0.0;
  for (std::size_t i = 0; i < std::min({max_observations, observations.size(), report.steps.size()}); ++i) {
    const TrackStep step = tracker.take(observations[i]);
    const TrackStep& reported = report.steps[i];
    if (!step.has_belief || !reported.has_belief || i < 20) continue;
    for (int k = 0; k < 3; ++k)
      sum += std::pow(step.belief.x[k] - reported.belief.x[k], 2) / (3.0 * reported.belief.P(k, k));
    num += 1.0;
  }
  return num > 0.0 ? std::sqrt(sum / num) : 0.0;
}

/// One row for the untested parameters of the rig; each has its own σ in other rows, so it does not affect the verdict.
std::optional<Assumption> not_tested(std::span<const TargetObservation> observations, const Rig& rig,
                                     const FollowConfig& config, const TrackReport& report) {
  const UnseenErrors unseen = unseen_errors(observations, rig.heads, config.tracker, rig.cov.size() > 0, report);
  if (unseen.params.empty() || unseen.worst.empty()) return std::nullopt;
  Assumption row{.name = "rig.not_tested", .value = std::nan(""), .moved = unseen_text(unseen)};
  row.sigma = unseen.sigma_share;
  row.ordinary = unseen.worst.front().share;
  row.moves = unseen.sigma_in_sigma.value_or(0.0) > 0.0 ? *unseen.sigma_in_sigma : std::nan("");
  return row;
}

/// One row for times that may have been rounded. They cannot be distinguished from exact ones, so the row does not
/// affect the verdict; if they can, σ of the answer includes the rounding.
std::optional<Assumption> times_not_tested(std::span<const TargetObservation> observations, const TrackReport& report,
                                           double sigma_clock_s) {
  if (report.rounded)
    return Assumption{.name = "times.rounded",
                      .value = report.rounded->step_s,
                      .sigma = 0.5 * report.rounded->step_s,
                      .ordinary = 0.5 * report.rounded->step_s,
                      .moves = std::nan(""),
                      .moved = rounded_check(*report.rounded).text};
  const auto move = move_within_step(observations, report);
  if (!move) return std::nullopt;
  Assumption row{
      .name = "times.not_tested", .value = move->step_s, .ordinary = move->step_s, .moved = step_text(*move)};
  row.sigma = sigma_clock_s;
  row.moves = std::nan("");
  return row;
}

/// One row for times of all heads that are equally late: the target is then where it was that much earlier, which no
/// observation reveals.
Assumption times_late_alike(const TrackReport& report, double sigma_clock_s) {
  const StepMove move = move_by_time(ordinary_clock_s, report);
  return {.name = "times.late_alike",
          .value = 0.0,
          .sigma = sigma_clock_s,
          .ordinary = ordinary_clock_s,
          .moves = std::nan(""),
          .moved =
              "whether the times of all heads are late alike no observations show: the target is where it was so "
              "much earlier, by " +
              text_of(1e3 * move.moved_m, 2) + " mm (" + text_of(move.moved_in_sigma, 2) + "σ) for each " +
              text_of(1e3 * move.step_s, 2) + " ms"};
}

}  // namespace

std::vector<HeadReading> readings_at(std::span<const TargetObservation> observations, std::size_t num_heads,
                                     double t_s) {
  std::vector<double> nearest_s(num_heads, 1.0);
  std::vector<const TargetObservation*> nearest(num_heads, nullptr);
  for (const TargetObservation& observation : observations) {
    const double apart_s = std::abs(observation.t_capture_s - t_s);
    if (observation.head >= num_heads || !(apart_s < nearest_s[observation.head])) continue;
    nearest_s[observation.head] = apart_s;
    nearest[observation.head] = &observation;
  }
  std::vector<HeadReading> readings;
  for (std::size_t h = 0; h < num_heads; ++h)
    if (nearest[h] != nullptr) readings.push_back({h, nearest[h]->pan_tilt_rad});
  return readings;
}

std::vector<Eigen::MatrixXd> meeting_sensitivity(std::span<const RigHead> heads, std::span<const HeadReading> readings,
                                                 const Eigen::Vector3d& point_in_world,
                                                 const Eigen::Vector3d& velocity_in_world) {
  std::vector<Eigen::MatrixXd> by(heads.size());
  std::vector<Eigen::Matrix<double, 2, 3>> J_points;
  std::vector<std::pair<std::size_t, Eigen::MatrixXd>> J_params;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const HeadReading& reading : readings) {
    const RigHead& head = heads[reading.head];
    const TurnedHead turned(head.head, reading.pan_tilt_rad);
    const Eigen::Vector3d point_in_cam = turned.point_in_cam(point_in_world);
    const auto seen = project_with_jacobians(head.camera, point_in_cam);
    if (!seen) continue;
    const Eigen::Index lens = seen->J_px_params.cols();
    Eigen::MatrixXd J(2, num_head_params + lens + 1);
    J << seen->J_px_point * turned.J_point_head(point_in_cam), seen->J_px_params,
        seen->J_px_point * turned.cam_from_world_rotation * velocity_in_world;
    J_points.emplace_back(seen->J_px_point * turned.cam_from_world_rotation);
    J_params.emplace_back(reading.head, J);
    information += J_points.back().transpose() * J_points.back();
  }
  if (J_points.size() < 2) return {};
  const Ldlt ldlt(information);
  if (!(ldlt.min_pivot() > 1e-14 * information.trace())) return {};
  for (std::size_t i = 0; i < J_points.size(); ++i)
    by[J_params[i].first] = -ldlt.solve_each(J_points[i].transpose() * J_params[i].second);
  return by;
}

std::vector<Assumption> track_assumed(std::span<const TargetObservation> observations, const Rig& rig,
                                      const FollowConfig& config, const TrackReport& report, const TrackGiven& given) {
  if (rig.heads.empty()) return {};
  const Median median = median_of_steps(observations, rig.heads, report);
  Lister lister(rig, median);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) lister.add_lens(h);
  for (std::size_t h = 1; h < rig.heads.size(); ++h) lister.add_mounting(h);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) lister.add_scales(h);
  if (given.sigma_clock_s > 0.0)
    for (std::size_t h = 0; h < rig.heads.size(); ++h) lister.add_clock(h, given.sigma_clock_s);
  if (given.sigma_px)  // weights the observations without biasing them: tested by NIS
    lister.assumed.push_back({.name = "sigma_px", .value = config.tracker.sigma_px, .sigma = 0.0});
  Assumption motion{.name = "motion_" + std::string(motion_name(config.tracker.method)) + ".sigma_a_m_s2",
                    .value = report.sigma_a_m_s2,
                    .moved = "position_m",
                    .remedy = "leave --sigma-a out, or try --method imm"};
  if (median.step != nullptr) motion.moves = moved_by_motion(observations, rig.heads, config, report);
  motion.ordinary = 0.333 * report.sigma_a_m_s2;
  if (!given.sigma_a) motion.sigma = motion.ordinary;  // as far as the innovations determine it
  lister.assumed.push_back(std::move(motion));
  for (Assumption& row : angles_assumed(observations, rig.heads, report, given.sigma_clock_s))
    lister.assumed.push_back(std::move(row));
  if (auto row = times_not_tested(observations, report, given.sigma_clock_s)) lister.assumed.push_back(std::move(*row));
  if (median.step != nullptr) lister.assumed.push_back(times_late_alike(report, given.sigma_clock_s));
  if (auto row = not_tested(observations, rig, config, report)) lister.assumed.push_back(std::move(*row));
  return std::move(lister.assumed);
}

}  // namespace alidade
