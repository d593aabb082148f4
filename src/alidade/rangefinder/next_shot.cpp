#include "alidade/rangefinder/next_shot.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/rangefinder/solve/beam_bound.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {
namespace {

constexpr int num_distances = 8, num_tilts = 4, num_sides = 8;

/// What is known of [beam, free lens parameters], and what shots would add to it.
class Planner {
 public:
  Planner(const BeamNow& now, const ShotLimits& limits) : now_(now), limits_(limits) {
    problem_.points_in_board = now.points_in_board;
    problem_.model.noise = now.beam.noise;
    problem_.sigma_corner_px = now.sigma_corner_px;
    problem_.estimate_scale = now.estimate_scale;
    prior_ = lens_prior(now.camera, true);
    information_ = known();
    prior_.information.setZero();  // it is in what is known; a shot must not bring it again
    for (const Eigen::Vector3d& point : now.points_in_board)
      centre_in_board_ += point / static_cast<double>(now.points_in_board.size());
  }

  struct Gain {
    NextShot shot;
    Eigen::MatrixXd information;
    double score = std::numeric_limits<double>::infinity();  ///< Mean variance of the points measured. [m²]
  };

  [[nodiscard]] std::optional<Gain> gain_of(double distance_m, double tilt_rad, double azimuth_rad) const {
    Gain gain;
    gain.shot = {distance_m, tilt_rad, azimuth_rad, board_at(distance_m, tilt_rad, azimuth_rad), 0.0, 0.0, 0.0};
    const auto added = information_of(gain.shot);
    if (!added) return std::nullopt;
    gain.information = information_ + *added;
    const Eigen::MatrixXd cov = inverse(gain.information);
    if (!cov.allFinite()) return std::nullopt;
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
    information_ = gain.information;
    const Eigen::MatrixXd cov = inverse(information_);
    Beam beam = now_.beam;
    Camera camera = now_.camera;
    const int p = problem_.num_free();
    const auto k = static_cast<Eigen::Index>(prior_.free.size());
    beam.cov.setZero();
    beam.cov.topLeftCorner(p, p) = cov.topLeftCorner(p, p);
    if (k > 0) {
      camera.cov(prior_.free, prior_.free) = cov.bottomRightCorner(k, k);
      beam.cov_with_lens.setZero(num_beam_params, prior_.mean.size());
      beam.cov_with_lens(Eigen::seqN(0, p), prior_.free) = cov.topRightCorner(p, k);
    }
    const BeamBound bound = judge_beam(problem_, beam, camera);
    NextShot shot = gain.shot;
    shot.sigma_origin_m = bound.sigma_origin_m;
    shot.sigma_direction_rad = bound.sigma_direction_rad;
    shot.spot_sigma_px = *std::max_element(bound.spot_sigma_px.begin(), bound.spot_sigma_px.end());
    return shot;
  }

 private:
  [[nodiscard]] static Eigen::MatrixXd inverse(const Eigen::MatrixXd& H) {
    const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
    const Ldlt ldlt(scale.asDiagonal() * H * scale.asDiagonal());
    return scale.asDiagonal() * ldlt.inverse() * scale.asDiagonal();
  }

  /// Information of the covariances at hand; a beam that is not known at all is within half a metre and half a radian.
  [[nodiscard]] Eigen::MatrixXd known() const {
    const int p = problem_.num_free();
    const auto k = static_cast<Eigen::Index>(prior_.free.size());
    Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(p + k, p + k);
    const bool knows_beam = now_.beam.cov.diagonal().head(p).minCoeff() > 0.0 && now_.beam.cov.allFinite();
    if (knows_beam) {
      cov.topLeftCorner(p, p) = now_.beam.cov.topLeftCorner(p, p);
    } else {
      cov.diagonal().head(p).setConstant(0.25);
    }
    if (k > 0) cov.bottomRightCorner(k, k) = now_.camera.cov(prior_.free, prior_.free);
    if (k > 0 && knows_beam && now_.beam.cov_with_lens.cols() == prior_.mean.size()) {
      cov.topRightCorner(p, k) = now_.beam.cov_with_lens(Eigen::seqN(0, p), prior_.free);
      cov.bottomLeftCorner(k, p) = cov.topRightCorner(p, k).transpose();
    }
    return inverse(cov);
  }

  /// The board's centre where the beam hits, its normal tilted so that the azimuth's side is farther.
  [[nodiscard]] Rigid3 board_at(double distance_m, double tilt_rad, double azimuth_rad) const {
    const Eigen::Vector3d axis(std::sin(azimuth_rad), -std::cos(azimuth_rad), 0.0);
    const Eigen::Quaterniond rotation = exp_so3(tilt_rad * axis);
    return {rotation, point_at(now_.beam, distance_m) - rotation * centre_in_board_};
  }

  /// Of a shot measured exactly as predicted; none where the camera does not see the board whole.
  [[nodiscard]] std::optional<Eigen::MatrixXd> information_of(const NextShot& next) const {
    BoardView view;
    for (std::size_t i = 0; i < now_.points_in_board.size(); ++i) {
      const auto px = project(now_.camera, next.cam_from_board * now_.points_in_board[i]);
      const bool is_inside = px && px->x() > 5.0 && px->y() > 5.0 && px->x() < now_.camera.width_px - 6.0 &&
                             px->y() < now_.camera.height_px - 6.0;
      if (!is_inside) return std::nullopt;
      view.corners.push_back({static_cast<int>(i), *px});
    }
    PreparedShot shot;
    shot.range_m = next.distance_m;
    shot.sigma_spot_px = now_.sigma_spot_px;
    if (now_.method != RangefinderMethod::plane) {
      shot.spot_px = project(now_.camera, point_at(now_.beam, next.distance_m));
      if (!shot.spot_px) return std::nullopt;
    }
    if (now_.method != RangefinderMethod::spot) shot.plane = plane_of(next.cam_from_board);
    shot.board = &view;
    BeamProblem one = problem_;
    one.shots = {shot};
    const auto system = common_system(one, prior_, {now_.beam, now_.camera, {next.cam_from_board}});
    if (!system) return std::nullopt;
    return system->information();
  }

  /// Of points at the origin, the nearest, the mean and the farthest range.
  [[nodiscard]] double mean_variance(const Eigen::MatrixXd& cov) const {
    const int p = problem_.num_free();
    const double mid_m = std::sqrt(limits_.min_range_m * limits_.max_range_m);
    double sum = 0.0;
    for (const double range_m : {0.0, limits_.min_range_m, mid_m, limits_.max_range_m}) {
      const Eigen::MatrixXd J = J_point_beam(now_.beam, range_m).leftCols(p);
      sum += 0.25 * (J * cov.topLeftCorner(p, p) * J.transpose()).trace();
    }
    return sum;
  }

  const BeamNow& now_;
  ShotLimits limits_;
  BeamProblem problem_;
  LensPrior prior_;
  Eigen::MatrixXd information_;
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
