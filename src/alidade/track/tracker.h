#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "alidade/estimation/interacting_models.h"
#include "alidade/estimation/motion_models.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/observation_model.h"
#include "alidade/track/track_step.h"

namespace alidade {

/// The motion models of the filter; those that can be requested by name: TrackMethod.
enum class TargetMotion { cv, singer, turn, resting, imm, ballistic };

/// cv, singer, turn, resting, imm, ballistic.
[[nodiscard]] std::string_view motion_name(TargetMotion method);

struct TrackerConfig {
  TargetMotion method = TargetMotion::cv;
  double sigma_px = 0.5;
  double sigma_encoder_rad = 0.0008726646259971648;  ///< 0.05°; for heads whose encoders have no σ of their own.
  double sigma_a_m_s2 = 1.0;                         ///< Roughly the target's peak acceleration; see the models.
  double singer_tau_s = 0.5;
  double resting_sigma_v_m_s = 0.9, resting_tau_s = 0.7;
  Eigen::Vector3d gravity_m_s2 = {0.0, 9.80665, 0.0};  ///< In the world, for ballistic and imm; default: y down.
  IteratedUpdateConfig update;
  double gate = 25.0;  ///< On NIS, 2 degrees of freedom: a correct observation fails it once in 270 000.
  double min_depth_m = 0.2, max_depth_m = 20.0;  ///< Working range of the rig, along a camera's optical axis.
  int restart_after = 2;       ///< Consecutive rejections for one head after which a new track is tried.
  double together_s = 0.06;    ///< Maximum time between two heads' observations to be intersected.
  double start_sigma_m = 1.0;  ///< Or a tenth of the distance, if that is more.
  double start_sigma_v_m_s = 2.0;
  double history_s = 0.3;      ///< Maximum delay of an observation.
  std::size_t max_kept = 256;  ///< Observations kept within history_s; older ones cannot be preceded by late ones.
  /// Errors of heads, lenses and clocks: included in every σ, and not estimated (Schmidt–Kalman). None: all exact.
  RigUncertainty errors;
  /// Estimate these errors instead: for tests of the rig, with white innovations. Not for imm, which considers them.
  bool learn_errors = false;
};

/// Tracks a target in 3-D through the pixels of moving heads, one observation at a time, each at its capture time
/// and with the angles of that instant, in any order of arrival. Allocates nothing after construction. Iterated
/// extended Kalman filter on pixels; docs/maths/tracking.md.
class Tracker {
 public:
  Tracker(std::vector<RigHead> heads, const TrackerConfig& config);
  ~Tracker();
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;

  TrackStep take(const TargetObservation& observation);
  /// The newest belief predicted to a time; none before the start, or before the newest capture time.
  [[nodiscard]] std::optional<Belief<6>> at(double t_s) const;
  /// The belief at the newest capture time that is at least `lag_s` before the last, given all observations since
  /// (within the history). None before the start, and for imm.
  struct Smoothed {
    double t_s;
    Belief<6> belief;
  };
  [[nodiscard]] std::optional<Smoothed> smoothed(double lag_s) const;

  /// u of the rig's errors as estimated so far, and its covariance. None if errors are not estimated.
  struct Learned {
    Eigen::VectorXd u;
    Eigen::MatrixXd cov;
  };
  [[nodiscard]] std::optional<Learned> learned() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Least-squares intersection of rays. None if they are parallel within 1 mrad.
[[nodiscard]] std::optional<Eigen::Vector3d> nearest_to_rays(const WorldRay& a, const WorldRay& b);

}  // namespace alidade
