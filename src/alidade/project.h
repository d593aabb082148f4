#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/description/field.h"
#include "alidade/estimation/config_error.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rig.h"
#include "alidade/public.h"

/// Applies calibrations: the pixel and point of a rangefinder's reading, and the projection matrices and pixels of a
/// pan-tilt rig, each with its covariance: everything that `alidade project` does.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Options of project_readings().
struct ProjectConfig {
  std::optional<double> sigma_range_m = {};  ///< σ of a reading. None: the beam's.
  std::optional<Camera> own_camera = {};     ///< The camera of the beam's calibration, if another one is used.
  std::string own_camera_name = {};          ///< Name of its file, for the verdict.
};

/// The fields of `config` that a user sets: sigma_range_m.
[[nodiscard]] FieldList fields_of(ProjectConfig& config);

struct ProjectedReading {
  double range_m = 0.0;
  BeamPoint point;
  std::optional<BeamPixel> pixel;  ///< None: outside the camera's view.
};

/// Points and pixels of readings, and the assumptions behind them.
struct BeamProjection {
  enum class Status { projected };
  Status status = Status::projected;
  std::vector<ProjectedReading> readings;  ///< One per range.
  Beam beam;                               ///< Beam as used: for another lens, without its covariance with the lens.
  Camera camera;
  std::vector<Assumption> assumed;
  Counts counts;  ///< Counts of readings; used: those in the camera's view.
  Verdict verdict;
};

/// Projects a rangefinder's readings [m] into its camera's frame and image. Throws ConfigError if there are no
/// readings, and for an invalid beam, camera or number.
[[nodiscard]] BeamProjection project_readings(const Beam& beam, const Camera& camera,
                                              const std::vector<double>& ranges_m, const ProjectConfig& config = {});

/// One head of a rig at its encoder readings.
struct HeadProjection {
  int id = 1;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 3, 4> M;  ///< (u, v, 1) ~ M (X, Y, Z, 1), the point in the world; no distortion.
  Eigen::Vector3d cam_centre_in_world = Eigen::Vector3d::Zero();
  std::optional<BeamPixel> pixel;  ///< Pixel of the point, with distortion; none: not in view, or no point given.
};

/// The heads of a rig at their encoder readings, and the pixels at which they see a point.
struct RigProjection {
  enum class Status { projected };
  Status status = Status::projected;
  std::vector<HeadProjection> heads;
  std::optional<Eigen::Vector3d> point_in_world;  ///< The point as given. [m]
  /// Covariance of the point by triangulation from the heads that see it: due to encoder noise and errors of rig and
  /// lenses, for exact pixels. None if fewer than two heads see it. [m²]
  std::optional<Eigen::Matrix3d> point_cov;
  Counts counts;  ///< Counts of heads.
  Verdict verdict;
};

/// `pans_rad`, `tilts_rad`: encoder readings, one for all heads or one per head. Throws ConfigError for a wrong number
/// of angles or more than a revolution, and for a rig that is invalid or has intrinsics that change with time.
[[nodiscard]] RigProjection project_rig(const Rig& rig, const std::vector<double>& pans_rad,
                                        const std::vector<double>& tilts_rad,
                                        const std::optional<Eigen::Vector3d>& point_in_world = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
