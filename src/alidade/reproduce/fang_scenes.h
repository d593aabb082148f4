#pragma once

#include <optional>
#include <vector>

#include "alidade/observe/filters/fang_observer.h"
#include "alidade/observe/filters/hybrid.h"
#include "alidade/simulate/rotation.h"

// The camera, motion and noise of Fang, Liu, Li & Zhang 2011, section V, and how an estimate of them is scored.

namespace alidade::reproduce {

inline const PixelScale paper_scale{{390.0, 291.0}, 400.0};
inline const Eigen::Vector4d paper_truth(710.0, 700.0, 390.0, 290.0), paper_start(500.0, 510.0, 400.0, 300.0);
inline constexpr double paper_sigma_px = 0.31622776601683794;  ///< √0.1: "variance 0.1".

/// Its observer with the constants above; the paper's motion has no ω_z.
[[nodiscard]] FangConfig paper_config(FangProfile profile);
/// Our default estimator with the paper's first guess.
[[nodiscard]] HybridObserver paper_hybrid();

/// Points that stand still, seen by the paper's camera and motion.
[[nodiscard]] RotationScene paper_scene(std::vector<Eigen::Vector2d> start_px);

/// Points, each anywhere 60 px inside the edges; a set with a triangle less than 40 px high is drawn again as a whole.
/// (draw_points() draws the last point again, and gets more sets that are crowded.)
[[nodiscard]] std::vector<Eigen::Vector2d> draw_set(std::uint64_t seed, int num_points = 4);

/// The paper's noise: of x of the first and third point, of y of the second and fourth.
void add_paper_noise(RotationLog& log, std::uint64_t seed);
/// One row whose pixels are off by 3 px each.
void add_burst(RotationLog& log, std::size_t row, std::uint64_t seed);

/// Intrinsics of experiment 3: 24 px more from 6 to 10 s. Eq. (29).
[[nodiscard]] Eigen::Vector4d zooming(double t_s);
/// Points under that zoom, as a camera sees them.
[[nodiscard]] RotationLog zoom_log(const std::vector<Eigen::Vector2d>& start_px);
/// The same as the paper's simulation must have been: its flow, eq. (11), with K(t) put in, which lacks what dK/dt
/// moves.
[[nodiscard]] RotationLog flow_only_zoom_log(const std::vector<Eigen::Vector2d>& start_px);

/// Ḡ of a log, as if its motion had been planned: from clean pixels, with the floor that the observer adds.
[[nodiscard]] Eigen::Matrix<double, 8, 8> mean_gramian_of(const RotationLog& clean);

/// The estimate after each row.
template <class Estimator>
[[nodiscard]] std::vector<IntrinsicsEstimate> observe_log(Estimator& estimator, const RotationLog& log) {
  MotionReader reader(log.source, 0.5);
  std::vector<IntrinsicsEstimate> estimates;
  estimates.reserve(log.rows.size());
  for (const RotationRow& row : log.rows) estimates.push_back(estimator.step(reader.next(row)));
  return estimates;
}

/// Estimate − truth of the four intrinsics in row `r`; infinite where there is none. [px]
[[nodiscard]] Eigen::Vector4d error_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates,
                                       std::size_t r);
/// Time after `from_s` from which on all four errors stay within `share` of their values, until `to_s`.
[[nodiscard]] double settle_s(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, double share,
                              double from_s, double to_s);
/// RMS of each error over [from_s, to_s]. [px]
[[nodiscard]] Eigen::Vector4d rms_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates,
                                     double from_s, double to_s);

}  // namespace alidade::reproduce
