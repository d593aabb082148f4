#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "alidade/camera/brown.h"
#include "alidade/camera/flat_port.h"
#include "alidade/camera/kannala_brandt.h"
#include "alidade/camera/pinhole.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A model together with its parameter values.
template <CameraModel Model>
struct Calibrated {
  using model = Model;
  Params<Model> params = Params<Model>::Zero();
};

/// Every lens this library knows. std::visit makes a forgotten case a compile error.
using Lens = std::variant<Calibrated<Pinhole>, Calibrated<Brown>, Calibrated<KannalaBrandt>, Calibrated<FlatPort>>;

/// What a calibration produces and everything else consumes: a plain value — copy it, compare it, write it to a file.
struct Camera {
  int width_px = 0;
  int height_px = 0;
  Lens lens = Calibrated<Brown>{};
  /// Covariance of all parameters of the lens in their order (a fixed parameter has zero rows); 0×0 where unknown.
  Eigen::MatrixXd cov;
  double rms_px = 0.0;  ///< Per point, of the calibration that made it; 0 where unknown.
  std::string source;   ///< Where it came from, for a user.
};

[[nodiscard]] std::string_view model_name(const Lens& lens);
[[nodiscard]] std::vector<std::string> param_names(const Lens& lens);
/// Whether all its rays meet in the camera's origin: true of all but flat_port.
[[nodiscard]] bool is_central(const Lens& lens);
[[nodiscard]] Eigen::VectorXd params(const Lens& lens);
/// The same model with other values. `values` has as many entries as the model has parameters.
[[nodiscard]] Lens with_params(const Lens& lens, const Eigen::VectorXd& values);
/// A pinhole as a Brown lens without distortion, its covariance (where it has one) with it; any other lens as it is.
[[nodiscard]] Camera with_distortion(const Camera& camera);
/// A lens of that name with all parameters zero. None for an unknown name.
[[nodiscard]] std::optional<Lens> make_lens(std::string_view model_name);

/// Pixel of a point in the camera frame, or none; see the model.
[[nodiscard]] std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& point_in_cam);
/// Projects a batch. One dispatch per call, not per point: the inner loop is compiled for the actual model.
[[nodiscard]] std::vector<std::optional<Eigen::Vector2d>> project(const Camera& camera,
                                                                  std::span<const Eigen::Vector3d> points_in_cam);
/// Unit ray of a pixel, in the camera frame, or none. Of a lens that is not central, its direction alone.
[[nodiscard]] std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Eigen::Vector2d& px);
[[nodiscard]] std::vector<std::optional<Eigen::Vector3d>> unproject(const Camera& camera,
                                                                    std::span<const Eigen::Vector2d> pixels);
/// Whether a pixel is in the image; integers are at the centres of pixels, so that it begins at -0.5.
[[nodiscard]] bool is_in_image(const Camera& camera, const Eigen::Vector2d& px);
/// Origin and direction of what a pixel sees, for any lens.
[[nodiscard]] std::optional<ObservationRay> observation_ray(const Camera& camera, const Eigen::Vector2d& px);
[[nodiscard]] std::vector<std::optional<ObservationRay>> observation_rays(const Camera& camera,
                                                                          std::span<const Eigen::Vector2d> pixels);
/// The point on the ray that is `range_m` from the camera's origin; none where the ray begins further away.
[[nodiscard]] std::optional<Eigen::Vector3d> point_at_range(const ObservationRay& ray, double range_m);

/// A pixel with its derivatives, for any model: J_px_params is 2 × number of parameters.
struct LensProjection {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 3> J_px_point;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> J_px_params;
};
[[nodiscard]] std::optional<LensProjection> project_with_jacobians(const Camera& camera,
                                                                   const Eigen::Vector3d& point_in_cam);
[[nodiscard]] std::vector<std::optional<LensProjection>> project_with_jacobians(
    const Camera& camera, std::span<const Eigen::Vector3d> points_in_cam);

ALIDADE_PUBLIC_END
}  // namespace alidade
