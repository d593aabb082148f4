#pragma once

#include <map>
#include <vector>

#include "alidade/localize.h"
#include "alidade/localize/distortion.h"
#include "alidade/localize/filter/filter.h"
#include "alidade/simulate/films/underwater_video.h"
#include "alidade/simulate/underwater.h"

// The protocol in which lenses and filters are compared under water; docs/maths/localization.md.

namespace alidade::reproduce {

/// A simulated sequence as a filter is given it, with its truth.
struct UnderwaterSample {
  Camera camera;
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
  LocalizeConfig config;
  std::map<long, Eigen::Vector3d> points;
};
[[nodiscard]] UnderwaterSample underwater_sample(const UnderwaterScene& scene, std::uint64_t seed);

/// The same from images: each frame is rendered, and the board's eight points are what find_board() finds in it, with
/// its σ. A frame in which the board is not found has no observations.
[[nodiscard]] UnderwaterSample filmed_sample(const UnderwaterScene& scene, const UnderwaterVideoConfig& video,
                                             std::uint64_t seed);

/// The same observations without a σ of their own: a filter takes its own for all.
[[nodiscard]] UnderwaterSample with_even_noise(UnderwaterSample sample);

/// Observations against where the true lens puts the true points.
struct ObservationErrors {
  double rms_px = 0.0;        ///< Of a coordinate.
  double chi2_per_dof = 0.0;  ///< By the observations' own σ.
  std::size_t num = 0;
};
[[nodiscard]] ObservationErrors observation_errors(const UnderwaterSample& sample);

/// A point of the map against the truth.
struct PointError {
  double percent = 0.0;  ///< 100 |ŷ − y| over the distance from the first camera.
  double nees = 0.0;     ///< eᵀ P⁻¹ e / 3.
};
[[nodiscard]] PointError point_error(const UnderwaterSample& sample, long id, const Eigen::Vector3d& is,
                                     const Eigen::Matrix3d& cov);

/// One run of the protocol on page docs/maths/localization.md: errors of points 1 and 5, and of the camera.
struct ProtocolRun {
  double p1_last = 0.0, p1_mean = 0.0, p5_last = 0.0, p5_mean = 0.0;  ///< [%], means over frames 10 to the end.
  double p1_above_2 = 0.0;  ///< Share of these frames with point 1 more than 2 % off.
  double p1_nees = 0.0, p5_nees = 0.0, worst_last = 0.0, camera_mm = 0.0, nis_per_dof = 0.0;
  std::vector<double> p1_percent, p5_percent;  ///< One per frame.
  Camera camera;
  Eigen::VectorXd sigma_lens;
};

/// As `alidade localize` does it. The paper's filter (no gate) never begins again.
[[nodiscard]] ProtocolRun run_protocol(const UnderwaterSample& sample, const Camera& camera,
                                       const LocalizationFilterConfig& filter, const FilterBankConfig& bank_config,
                                       FeatureKind kind);

/// The published filter of the protocol: positions, all observations of a frame at once, iterated, one start, no gate.
[[nodiscard]] LocalizationFilterConfig paper_filter();

/// The recommended one for so few points.
[[nodiscard]] LocalizationFilterConfig recommended_filter();

}  // namespace alidade::reproduce
