#include "alidade/rangefinder/next_shot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/so3.h"
#include "alidade/rangefinder/checks/repeated_shots.h"
#include "alidade/rangefinder/solve/foreseen_beam.h"

namespace alidade {
namespace {

constexpr int num_distances = 8, num_tilts = 4, num_sides = 8;

/// What is known, and what shots would add to it.
class Planner {
 public:
  Planner(const BeamNow& now, const ShotLimits& limits) : now_(now), limits_(limits), foreseen_(now) {
    for (const Eigen::Vector3d& point : now.points_in_board)
      centre_in_board_ += point / static_cast<double>(now.points_in_board.size());
  }

  struct Gain {
    NextShot shot;
    Shot seen;  ///< As it would be measured.
    Eigen::MatrixXd information;
    double score = std::numeric_limits<double>::infinity();  ///< Mean variance of the points measured. [m²]
  };

  /// None where the camera does not see the board whole, and where rangefinder() would average the shot with one
  /// that is taken.
  [[nodiscard]] std::optional<Gain> gain_of(double distance_m, double tilt_rad, double azimuth_rad) const {
    Gain gain;
    const Rigid3 cam_from_board = board_at(distance_m, tilt_rad, azimuth_rad);
    gain.shot = {distance_m, tilt_rad, azimuth_rad, cam_from_board, 0.0, 0.0, 0.0};
    gain.seen.range_m = distance_m;
    gain.seen.board = foreseen_.board_at(cam_from_board);
    if (!gain.seen.board || is_taken(gain.seen)) return std::nullopt;
    auto added = foreseen_.information_of(distance_m, cam_from_board, *gain.seen.board, now_.sees_spots);
    if (!added) return std::nullopt;
    const Eigen::MatrixXd cov = foreseen_.cov_with(*added);
    if (!cov.allFinite()) return std::nullopt;
    gain.information = std::move(*added);
    gain.score = mean_variance(cov);
    return gain;
  }

  [[nodiscard]] std::vector<double> distances_m() const {
    std::vector<double> distances;
    for (int i = 0; i < num_distances; ++i)
      distances.push_back(limits_.min_range_m *
                          std::pow(limits_.max_range_m / limits_.min_range_m, i / (num_distances - 1.0)));
    return distances;
  }
  [[nodiscard]] std::vector<double> tilts_rad() const {
    std::vector<double> tilts;
    for (int i = 0; i < num_tilts; ++i) tilts.push_back(limits_.max_tilt_rad * i / (num_tilts - 1.0));
    return tilts;
  }

  /// The best side of one distance and tilt.
  [[nodiscard]] std::optional<Gain> best_side(double distance_m, double tilt_rad) const {
    std::optional<Gain> best;
    for (int side = 0; side < (tilt_rad > 0.0 ? num_sides : 1); ++side) {
      auto gain = gain_of(distance_m, tilt_rad, side * 2.0 * std::numbers::pi / num_sides);
      if (gain && (!best || gain->score < best->score)) best = std::move(gain);
    }
    return best;
  }

  /// Takes the shot: what follows counts it.
  NextShot take(const Gain& gain) {
    foreseen_.add(gain.information);
    taken_.push_back(gain.seen);
    const BeamBound bound = foreseen_.bound();
    NextShot shot = gain.shot;
    shot.sigma_origin_m = bound.sigma_origin_m;
    shot.sigma_direction_rad = bound.sigma_direction_rad;
    shot.spot_sigma_px = *std::max_element(bound.spot_sigma_px.begin(), bound.spot_sigma_px.end());
    return shot;
  }

 private:
  [[nodiscard]] bool is_taken(const Shot& shot) const {
    return std::ranges::any_of(taken_, [&](const Shot& taken) { return at_one_placement(taken, shot); });
  }

  /// The board's centre where the beam hits, its normal tilted so that the azimuth's side is farther.
  [[nodiscard]] Rigid3 board_at(double distance_m, double tilt_rad, double azimuth_rad) const {
    const Eigen::Vector3d axis(std::sin(azimuth_rad), -std::cos(azimuth_rad), 0.0);
    const Eigen::Quaterniond rotation = exp_so3(tilt_rad * axis);
    return {rotation, point_at(now_.beam, distance_m) - rotation * centre_in_board_};
  }

  /// Of points at the origin, the nearest, the mean and the farthest range.
  [[nodiscard]] double mean_variance(const Eigen::MatrixXd& cov) const {
    const double mid_m = std::sqrt(limits_.min_range_m * limits_.max_range_m);
    double sum = 0.0;
    for (const double range_m : {0.0, limits_.min_range_m, mid_m, limits_.max_range_m}) {
      const Eigen::MatrixXd J = J_point_beam(now_.beam, range_m).leftCols(cov.cols());
      sum += 0.25 * (J * cov * J.transpose()).trace();
    }
    return sum;
  }

  const BeamNow& now_;
  ShotLimits limits_;
  ForeseenBeam foreseen_;
  std::vector<Shot> taken_;
  Eigen::Vector3d centre_in_board_ = Eigen::Vector3d::Zero();
};

}  // namespace

std::vector<NextShot> plan_next_shots(const BeamNow& now, const ShotLimits& limits, int num_shots,
                                      const Progress& progress) {
  std::vector<NextShot> shots;
  if (now.points_in_board.size() < 4) return shots;
  Planner planner(now, limits);
  for (int i = 0; i < num_shots; ++i) {
    report_progress(progress, "shots", static_cast<std::size_t>(i), static_cast<std::size_t>(num_shots));
    std::optional<Planner::Gain> best;
    for (const double distance_m : planner.distances_m()) {
      for (const double tilt_rad : planner.tilts_rad()) {
        auto gain = planner.best_side(distance_m, tilt_rad);
        if (gain && (!best || gain->score < best->score)) best = std::move(gain);
      }
    }
    if (!best) break;
    shots.push_back(planner.take(*best));
  }
  return shots;
}

std::vector<ShotGain> next_shot_gains(const BeamNow& now, const ShotLimits& limits) {
  std::vector<ShotGain> gains;
  if (now.points_in_board.size() < 4) return gains;
  const Planner planner(now, limits);
  for (const double distance_m : planner.distances_m()) {
    for (const double tilt_rad : planner.tilts_rad()) {
      if (const auto gain = planner.best_side(distance_m, tilt_rad))
        gains.push_back({distance_m, tilt_rad, std::sqrt(gain->score)});
    }
  }
  return gains;
}

}  // namespace alidade
