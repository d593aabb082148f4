#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/pantilt/intrinsics_history.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/public.h"
#include "alidade/servo/config.h"
#include "alidade/simulate/target_path.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Model mismatch: factors of the true plants on gain and time constant, and the additional delay of their commands.
struct PlantMismatch {
  double gain = 1.0, tau = 1.0, later_s = 0.0;
};

/// The true axis: gain and time constant times the factors, command delay longer by `later_s` but not below 0 [s].
[[nodiscard]] ServoAxis as_it_is(const ServoAxis& known, const PlantMismatch& mismatch);

/// σ of an identified plant: gain in its own unit, time constant, command delay. 0: exact.
struct PlantSigma {
  double gain = 0.0, tau_s = 0.0, command_delay_s = 0.0;

  [[nodiscard]] bool is_exact() const { return gain == 0.0 && tau_s == 0.0 && command_delay_s == 0.0; }
};

/// Which intrinsics the controllers use for pixels: the rig's, whatever the lens does; those that an on-line observer
/// estimates from the background of the images; the true ones.
enum class LensKnowledge { given, observed, truth };
[[nodiscard]] std::string_view lens_knowledge_name(LensKnowledge knowledge);  ///< given, observed, true
[[nodiscard]] std::optional<LensKnowledge> lens_knowledge_named(std::string_view name);

/// The closed loop of one target, two or more heads, and a controller on each. Images are taken, encoders read and
/// commands sent once per period; an image is available `latency_s` after it was taken.
struct ServoScene {
  std::vector<RigHead> heads;       ///< Their encoders' σ is that of the readings.
  RigUncertainty rig_errors;        ///< From the rig's file; considered by `track`.
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt) of every head, as known to the controllers.
  PlantMismatch mismatch;
  PlantSigma plant_sigma;  ///< Loops must be stable within three of these σ.
  TargetPath path;
  double duration_s = 12.0;
  double warm_up_s = 2.0;  ///< Excluded from the figures of merit.
  double period_s = 0.05;
  double latency_s = 0.0;
  double sigma_px = 0.5;
  double sigma_encoder_rad = 0.0008726646259971648;
  double encoder_step_rad = 0.0;
  std::vector<std::pair<double, double>> hidden_s;  ///< Intervals (from, to) in which no head sees the target.
  ZoomProfile zoom;                                 ///< Zoom of all lenses over time.
  LensKnowledge intrinsics = LensKnowledge::given;
  std::size_t background_points = 24;  ///< Static points in view of the heads, for the observer.
};

/// Preset C5: rig, plant, target and noise of Xiahou, Chen & Wu, 2015.
[[nodiscard]] ServoScene xiahou_servo_scene();

/// One head in one period.
struct ServoRow {
  double t_s = 0.0;
  std::size_t head = 0;
  Eigen::Vector2d command, asked_rad, measured_rad, predicted_rad, rate_rad_s, sigma_predicted_px;
  bool has_prediction = false;
  Eigen::Vector2d error_px;  ///< True pixel of the target − image centre; NaN behind the camera.
  /// Length of the error 1/3 and 2/3 into the following period; 3.14 · focal length at most, and behind the camera.
  std::array<double, 2> error_between_px{};
  bool is_in_image = false;
  std::optional<Eigen::Vector2d> seen_px;  ///< Noisy pixel of the target, if the head saw it.
  ServoEvent event = ServoEvent::none;
  IntrinsicsSample lens;  ///< Intrinsics that the controller uses for this image: estimated, or the rig's.
  Eigen::Vector4d true_lens = Eigen::Vector4d::Zero();  ///< fx, fy, cx, cy. [px]
};

/// Figures of merit of one run or of several runs combined. Errors are distances |(u, v) − centre| of all heads, at the
/// periods; for `between_px` at thirds of the periods, for `max_px` at both.
struct ServoFigures {
  double rms_px = 0.0;
  double between_px = 0.0;  ///< RMS at thirds of the periods, when the target is between two images.
  double p95_px = 0.0;
  double max_px = 0.0;
  double central_third = 0.0;  ///< Share of periods with the target within the central third in both directions.
  double in_image = 0.0;       ///< Share of periods.
  std::size_t num_lost = 0;    ///< How often a target that had been tracked was lost…
  std::size_t num_found = 0;   ///< …and found again.
  double search_s = 0.0;       ///< Time spent searching, summed over the heads.
  double unseen = 0.0;         ///< Share of the time in which a head has not yet seen the target.
  /// Per head: share of the time, at the end of the run, in which the target is out of its image for good.
  std::vector<double> gone;
  std::vector<double> errors_px;  ///< In ascending order; `p95_px` is their 95 % quantile.
  double focal_share = 0.0;       ///< RMS error of the controllers' fx, relative to the true fx.
  double focal_z = 0.0;           ///< The same in units of its σ; 0 if it has none.
};

struct ServoRun {
  std::vector<ServoRow> rows;  ///< In chronological order, then by head.
  ServoFigures figures;
};

/// One run of a controller. `config.axes` and `period_s` are taken from the scene. `watch` is called with each row;
/// exceptions from it end the run.
[[nodiscard]] ServoRun run_servo(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed,
                                 const std::function<void(const ServoRow&)>& watch = {});

/// RMS over all runs; maxima of `max_px` and of each head's `gone`; the 95 % quantile of all errors; means of the other
/// shares; sums of the counts.
[[nodiscard]] ServoFigures put_together(const std::vector<ServoFigures>& runs);

/// RMS for each pair of factors on gain and time constant, gain-major: rms_px[gain · num_tau + tau].
struct ServoRobustness {
  std::vector<double> gain_factors, tau_factors;
  std::vector<double> rms_px;
};
[[nodiscard]] ServoRobustness servo_robustness(const ServoScene& scene, const ServoConfig& config,
                                               std::vector<double> gain_factors, std::vector<double> tau_factors,
                                               std::uint64_t seed, const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
