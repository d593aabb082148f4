#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/localize/filter_bank.h"
#include "alidade/localize/known_pose.h"
#include "alidade/localize/path_error.h"
#include "alidade/localize/path_smoother.h"
#include "alidade/localize/radial_residuals.h"
#include "alidade/localize/residual_structure.h"

namespace alidade {

/// What was seen of numbered points in one image.
struct ObservationFrame {
  long frame = 0;
  double t_s = 0.0;
  std::vector<FeatureObservation> observations;
};

/// What is believed of a point's depth before it is seen: along the optical axis where it is first seen.
struct ToldDepth {
  long id = 0;
  double depth_m = 1.0;
  double sigma_rel = 0.03;
};

/// When a new point enters the state.
enum class NewPoints {
  inverse_depth,  ///< With its first observation, as an inverse depth.
  xyz,            ///< With its first observation, as a place.
  delayed,        ///< When two of its observations tell its depth to 5 %, as an inverse depth.
};

enum class FrameEvent {
  waiting,  ///< Not started yet: no pose.
  started,
  tracked,
  predicted,  ///< Fewer than three points used: the pose is mostly the motion's.
  restarted,
};
[[nodiscard]] std::string_view event_name(FrameEvent event);

struct PathStep {
  long frame = 0;
  double t_s = 0.0;
  FrameEvent event = FrameEvent::waiting;
  Rigid3 world_from_cam;
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< Of the right perturbation.
  std::size_t num_seen = 0, num_tracked = 0, num_gated = 0, num_features = 0;
  std::size_t num_known = 0, num_known_gated = 0;  ///< Of those used or gated: the target's.
  double nis_per_dof = std::numeric_limits<double>::quiet_NaN();
  double seconds = 0.0;

  [[nodiscard]] bool has_pose() const { return event != FrameEvent::waiting; }
};

struct LocalizeConfig {
  LocalizationFilterConfig filter;
  FilterBankConfig bank;
  std::optional<StartHypothesis> start;  ///< Else from the target, else the world is the first camera, scale unknown.
  std::vector<KnownPoint> target;
  std::vector<ToldDepth> depths;
  double depth_m = 0.0;      ///< Of points that are not in `depths`; 0: the target's distance.
  double sigma_depth = 0.5;  ///< Of those, over the depth.
  NewPoints new_points = NewPoints::inverse_depth;
  bool smooths = true;  ///< With a target: the path is made anew from all observations once the last frame is there.
  double sigma_scale = 0.0;       ///< Of the target's size, relative: counted.
  bool is_scale_told = true;      ///< Whether that, or the σ of its points, is known.
  bool is_board = false;          ///< The target is a printed board, which has one side.
  bool seen_from_plus_z = false;  ///< The side from which told points are seen is said to be that of +z.
  bool restarts = true;           ///< From the target where the innovations say that the path is wrong.
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;  ///< At a start from the target or from nothing.
  std::function<double()> seconds;                       ///< A clock, if frames are to be timed.
  std::function<void(const PathStep&)> watch;            ///< Is shown each step; what it throws ends the work.
  /// Is shown the filter after each frame of localize_observations that has one.
  std::function<void(const LocalizationFilter&)> inspect;
};

struct MapPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  bool is_known = false;
  std::size_t num_seen = 0;
};

struct LocalizeReport {
  std::vector<PathStep> path;  ///< One a frame.
  std::vector<MapPoint> map;   ///< At the end.
  bool scale_known = false;
  bool has_target = false;  ///< Known points were given.
  bool is_of_images = false;
  double sigma_px =
      std::numeric_limits<double>::quiet_NaN();  ///< Of an observation that brings none; of images the floor.
  std::size_t num_lost = 0;  ///< Frames without a pose that observations hold: waiting or predicted.
  std::size_t num_restarts = 0;
  std::size_t num_observations = 0, num_used = 0, num_gated = 0, max_seen = 0;
  std::size_t num_known = 0, num_known_gated = 0;
  double nis_per_dof = std::numeric_limits<double>::quiet_NaN();
  /// How far the target's points have gone in the map from where they were told to be: squares over σ², per number.
  double known_shift = std::numeric_limits<double>::quiet_NaN();
  RadialStructure radial;      ///< Of what observations are off after the update: what a wrong lens leaves.
  std::size_t num_alike = 1;   ///< Things seen at once that might be the target, where a start failed for it.
  Camera camera;               ///< As it is at the end.
  Eigen::VectorXd sigma_lens;  ///< Of the parameters that were estimated.
  PathError error;             ///< With truth.
  bool is_scale_told = true, is_board = false;  ///< As in LocalizeConfig.
  bool is_behind = false;           ///< Most poses are on the side of a flat target from which it is not seen.
  ResidualStructure residuals;      ///< Of a smoothed path.
  bool is_smoothed = false;         ///< Path and map are from all observations together, not each from those before it.
  std::size_t num_unexplained = 0;  ///< Frames of a smoothed path of which most observations do not fit it.
  double widened = 1.0;             ///< Of a smoothed path: see SmoothedPath,
  bool is_from_one_place = false;   ///< and this, too.
  std::vector<GivenNumber> given;   ///< What was given, and what it does.
  double lens_pull = 0.0;           ///< Of a lens that was estimated: how far from what was told, in the told σ.
};

/// The path of a camera through all frames, in order of time, and the map of its points.
[[nodiscard]] LocalizeReport localize_observations(const Camera& camera, std::span<const ObservationFrame> frames,
                                                   const LocalizeConfig& config, std::span<const TimedPose> truth = {},
                                                   const Progress& progress = {});

/// What the path takes as given: the camera, and the target's scale.
[[nodiscard]] std::vector<Assumption> localize_assumed(const LocalizeReport& report);

/// Whether the path stands. A path that its observations contradict is never good.
[[nodiscard]] Verdict localize_verdict(const LocalizeReport& report);

}  // namespace alidade
