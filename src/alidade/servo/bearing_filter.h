#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "alidade/estimation/belief.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

inline constexpr std::size_t num_agilities = 5;

/// One axis of a target's bearing from a head: angle, rate, acceleration; a bank of Singer models with different
/// manoeuvre intensities, weighted by the likelihood of their past predictions.
struct BearingFilterConfig {
  double singer_tau_s = 0.4;  ///< Correlation time of the target's acceleration.
  /// σ of the target's angular acceleration: 5, 20, 80, 320 and 1280 °/s². For a single model: set all of them equal.
  std::array<double, num_agilities> sigma_rad_s2{0.08726646, 0.34906585, 1.3962634, 5.5850536, 22.340214};
  double memory_s = 0.5;          ///< Time constant of the models' likelihoods (fading memory).
  double start_rate_rad_s = 2.0;  ///< σ of the rate of a target when it is first seen.
  double gate = 20.0;             ///< On the squared innovation of the mixture over its variance: 4.5 σ.
  int restart_after = 2;          ///< Consecutive observations outside the gate that count as a jump of the target.
};

/// Effect on a bearing of a 1σ error of the lens: of the focal length, of the principal point. These errors are
/// constant: they are considered (Schmidt–Kalman), not averaged out. S. F. Schmidt, 1966.
using LensEffect = Eigen::RowVector2d;

struct Bearing {
  double angle_rad = 0.0, rate_rad_s = 0.0, acceleration_rad_s2 = 0.0;
  double sigma_rad = 0.0;  ///< σ of the angle.
};

/// The bearing dt ≥ 0 later, with decaying acceleration; σ is unchanged.
[[nodiscard]] Bearing ahead(const Bearing& bearing, double singer_tau_s, double dt_s);

/// One axis of the filter. R. A. Singer, 1970; static multiple models: D. T. Magill, "Optimal adaptive estimation of
/// sampled stochastic processes", 1965, with fading memory. Allocates no memory.
class BearingAxis {
 public:
  explicit BearingAxis(const BearingFilterConfig& config) : config_(config) {}

  void start(double t_s, double angle_rad, double variance_rad2, const LensEffect& effect = LensEffect::Zero());
  /// Squared innovation of the mixture over its variance. That variance is predicted for an observation `usual_gap_s`
  /// after the last: a longer gap does not make a jump plausible. `variance_rad2` includes all errors of a bearing.
  [[nodiscard]] double surprise(double t_s, double angle_rad, double variance_rad2, double usual_gap_s) const;
  void update(double t_s, double angle_rad, double variance_rad2, const LensEffect& effect = LensEffect::Zero());
  /// The mixture at a time not earlier than the last observation.
  [[nodiscard]] Bearing at(double t_s) const;
  /// Weights of the models, summing to 1.
  [[nodiscard]] const std::array<double, num_agilities>& weights() const { return weights_; }

 private:
  BearingFilterConfig config_;
  std::array<Belief<3>, num_agilities> beliefs_{};
  std::array<Eigen::Matrix<double, 3, 2>, num_agilities> with_lens_{};  ///< Cross-covariance of state and lens errors.
  std::array<double, num_agilities> log_weights_{}, weights_{};
  double t_s_ = 0.0;
};

enum class ObservationUse { used, started, gated, restarted, late };

/// Both axes of a head: the bearing is the (pan, tilt) at which the head would point at the target.
class BearingFilter {
 public:
  explicit BearingFilter(const BearingFilterConfig& config)
      : config_(config), axes_{BearingAxis(config), BearingAxis(config)} {}

  /// Adds a bearing at its capture time, with this σ on both axes, and the effect of lens errors on each axis. Bearings
  /// older than the last one are rejected.
  ObservationUse take(double t_capture_s, const Eigen::Vector2d& bearing_rad, double sigma_rad,
                      const std::array<LensEffect, 2>& effects = {LensEffect::Zero(), LensEffect::Zero()});
  [[nodiscard]] bool has_started() const { return has_started_; }
  [[nodiscard]] double newest_s() const { return newest_s_; }
  [[nodiscard]] std::array<Bearing, 2> at(double t_s) const { return {axes_[0].at(t_s), axes_[1].at(t_s)}; }
  void forget() { has_started_ = false; }

 private:
  ObservationUse begin(double t_s, const Eigen::Vector2d& bearing_rad, double variance,
                       const std::array<LensEffect, 2>& effects, ObservationUse as);

  BearingFilterConfig config_;
  std::array<BearingAxis, 2> axes_;
  bool has_started_ = false;
  int num_gated_ = 0;
  double newest_s_ = 0.0, usual_gap_s_ = 0.0;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
