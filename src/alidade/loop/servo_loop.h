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

/// Model mismatch: the true plants, as factors on the known ones, and by how much later their commands act.
struct PlantMismatch {
  double gain = 1.0, tau = 1.0, later_s = 0.0;
};

/// The axis as it truly is: gain and time constant by those factors, its delay of commands [s] later, at least 0.
[[nodiscard]] ServoAxis as_it_is(const ServoAxis& known, const PlantMismatch& mismatch);

/// σ of a plant that was identified: of its gain in its unit, of its time constant, of its delay of commands. 0: exact.
struct PlantSigma {
  double gain = 0.0, tau_s = 0.0, command_delay_s = 0.0;

  [[nodiscard]] bool is_exact() const { return gain == 0.0 && tau_s == 0.0 && command_delay_s == 0.0; }
};

/// Which intrinsics the loop takes its pixels by: the rig's, whatever the lens does; those that an on-line observer
/// estimates from the images' background; the true ones.
enum class LensKnowledge { given, observed, truth };
[[nodiscard]] std::string_view lens_knowledge_name(LensKnowledge knowledge);  ///< given, observed, true
[[nodiscard]] std::optional<LensKnowledge> lens_knowledge_named(std::string_view name);

/// The closed loop of one target, two heads or more, and a controller on each. Images are taken, encoders read and
/// commands sent each period; an image is known `latency_s` after it was taken.
struct ServoScene {
  std::vector<RigHead> heads;       ///< Their encoders' σ is that of the readings.
  RigUncertainty rig_errors;        ///< What the rig's file says of its own; `track` counts it.
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt) of every head, as known.
  PlantMismatch mismatch;
  PlantSigma plant_sigma;  ///< Loops have to be stable within three of it.
  TargetPath path;
  double duration_s = 12.0;
  double warm_up_s = 2.0;  ///< Excluded from the figures.
  double period_s = 0.05;
  double latency_s = 0.0;
  double sigma_px = 0.5;
  double sigma_encoder_rad = 0.0008726646259971648;
  double encoder_step_rad = 0.0;
  std::vector<std::pair<double, double>> hidden_s;  ///< From, to: no head sees the target.
  ZoomProfile zoom;                                 ///< Of all heads' lenses.
  LensKnowledge intrinsics = LensKnowledge::given;
  std::size_t background_points = 24;  ///< Static, where the heads look, for the observer.
};

/// The preset of C5: the rig, plant, target and noise of Xiahou, Chen & Wu, 2015.
[[nodiscard]] ServoScene xiahou_servo_scene();

/// One head at one period.
struct ServoRow {
  double t_s = 0.0;
  std::size_t head = 0;
  Eigen::Vector2d command, asked_rad, measured_rad, predicted_rad, rate_rad_s, sigma_predicted_px;
  bool has_prediction = false;
  Eigen::Vector2d error_px;  ///< True image of the target − centre of the image; NaN behind the camera.
  /// Its length at a third and at two thirds of the period that follows; as in figures behind the camera.
  std::array<double, 2> error_between_px{};
  bool is_in_image = false;
  std::optional<Eigen::Vector2d> seen_px;  ///< Where the head saw the target, with its noise.
  ServoEvent event = ServoEvent::none;
  IntrinsicsSample lens;                                ///< That this image will be taken by, or the rig's.
  Eigen::Vector4d true_lens = Eigen::Vector4d::Zero();  ///< fx, fy, cx, cy. [px]
};

/// Figures of one run, or of several put together. Errors are distances |(u, v) − centre| at the periods, all heads;
/// `between_px` and `max_px` at thirds of them, too.
struct ServoFigures {
  double rms_px = 0.0;
  double between_px = 0.0;  ///< RMS at thirds of the periods, where the target is between two images.
  double p95_px = 0.0;
  double max_px = 0.0;
  double central_third = 0.0;  ///< Share within the central third in both directions.
  double in_image = 0.0;       ///< Share.
  std::size_t num_lost = 0;    ///< How often a target that had been followed was lost…
  std::size_t num_found = 0;   ///< …and found again.
  double search_s = 0.0;       ///< Time spent searching, all heads.
  double unseen = 0.0;         ///< Share of the time in which a head has not yet seen the target.
  /// Of each head: the share of the time, at its end, in which the target is no more in its image.
  std::vector<double> gone;
  std::vector<double> errors_px;  ///< Of which `p95_px` is the 95 % quantile, in order of size.
  double focal_share = 0.0;       ///< RMS error of fx as the loop has it, over the true one.
  double focal_z = 0.0;           ///< The same over its σ; 0 where it states none.
};

struct ServoRun {
  std::vector<ServoRow> rows;  ///< In order of time, heads in order.
  ServoFigures figures;
};

/// One run of a controller. `config.axes` and `period_s` are the scene's. `watch` is shown each row as it comes; what
/// it throws ends the run.
[[nodiscard]] ServoRun run_servo(const ServoScene& scene, const ServoConfig& config, std::uint64_t seed,
                                 const std::function<void(const ServoRow&)>& watch = {});

/// RMS of all runs, the largest of the runs' maxima and of what each head is without the target at the end, 95 % of all
/// errors, means of the other shares, sums of the counts.
[[nodiscard]] ServoFigures put_together(const std::vector<ServoFigures>& runs);

/// RMS over factors on gain and time constant, gain by gain: rms_px[gain · num_tau + tau].
struct ServoRobustness {
  std::vector<double> gain_factors, tau_factors;
  std::vector<double> rms_px;
};
[[nodiscard]] ServoRobustness servo_robustness(const ServoScene& scene, const ServoConfig& config,
                                               std::vector<double> gain_factors, std::vector<double> tau_factors,
                                               std::uint64_t seed, const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
