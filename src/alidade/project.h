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

/// Calibrations at work: the pixel and point of a rangefinder's reading, and the matrices and pixels of a pan-tilt rig,
/// each with its covariance: the whole job, as `alidade project` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Options of project_readings().
struct ProjectConfig {
  std::optional<double> sigma_range_m = {};  ///< Of a reading. None: the beam's.
  std::optional<Camera> own_camera = {};     ///< That the beam was calibrated with, where another one is used.
  std::string own_camera_name = {};          ///< Of its file, for the verdict.
};

/// The fields of `config` that a user sets: sigma_range_m.
[[nodiscard]] FieldList fields_of(ProjectConfig& config);

struct ProjectedReading {
  double range_m = 0.0;
  BeamPoint point;
  std::optional<BeamPixel> pixel;  ///< None: the camera does not see it.
};

/// Points and pixels of readings, and what they take as given.
struct BeamProjection {
  enum class Status { projected };
  Status status = Status::projected;
  std::vector<ProjectedReading> readings;  ///< One per range.
  Beam beam;                               ///< As used: without the covariance with another lens.
  Camera camera;
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of readings; used: those that the camera sees.
  Verdict verdict;
};

/// Where a rangefinder's readings [m] are, in its camera and in the image. Throws ConfigError for no readings, and for
/// an invalid beam, camera or number.
[[nodiscard]] BeamProjection project_readings(const Beam& beam, const Camera& camera,
                                              const std::vector<double>& ranges_m, const ProjectConfig& config = {});

/// One head of a rig at its readings.
struct HeadProjection {
  int id = 1;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 3, 4> M;  ///< (u, v, 1) ~ M (X, Y, Z, 1) of the world, the lens without its distortion.
  Eigen::Vector3d cam_centre_in_world = Eigen::Vector3d::Zero();
  std::optional<BeamPixel> pixel;  ///< Of the point, through the whole lens; none: not seen, or no point.
};

/// The heads of a rig at their readings, and where they see a point.
struct RigProjection {
  enum class Status { projected };
  Status status = Status::projected;
  std::vector<HeadProjection> heads;
  std::optional<Eigen::Vector3d> point_in_world;  ///< As given. [m]
  /// How well the heads that see the point determine where it is: by their encoders' noise and the errors of rig and
  /// lenses, a pixel being exact. None where fewer than two see it. [m²]
  std::optional<Eigen::Matrix3d> point_cov;
  Counts counts;  ///< Of heads.
  Verdict verdict;
};

/// `pans_rad`, `tilts_rad`: what the encoders read, one for all heads or one for each. Throws ConfigError for a
/// wrong number of angles or more than a revolution, and for an invalid rig, or one whose intrinsics change with time.
[[nodiscard]] RigProjection project_rig(const Rig& rig, const std::vector<double>& pans_rad,
                                        const std::vector<double>& tilts_rad,
                                        const std::optional<Eigen::Vector3d>& point_in_world = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
