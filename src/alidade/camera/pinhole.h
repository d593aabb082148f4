#pragma once

#include <array>

#include "alidade/camera/camera_model.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Ideal perspective camera: (u, v) = (fx x + skew y + cx, fy y + cy), x = X/Z, y = Y/Z.
/// Hartley & Zisserman, "Multiple View Geometry", 2003, eq. (6.10).
struct Pinhole {
  static constexpr std::string_view name = "pinhole";
  static constexpr bool is_central = true;
  static constexpr int num_params = 5;
  static constexpr std::array<std::string_view, num_params> param_names{"fx", "fy", "cx", "cy", "skew"};

  struct Domain {};  ///< All that is in front of the camera.
  [[nodiscard]] static Domain domain(const Params<Pinhole>& params);

  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<Pinhole>& params,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<Pinhole>> project_with_jacobians(const Params<Pinhole>& params,
                                                                                 const Eigen::Vector3d& point_in_cam);
  /// Unit ray of a pixel, in the camera frame.
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<Pinhole>& params,
                                                                const Eigen::Vector2d& px);

  /// The same for a batch, with the domain computed once.
  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<Pinhole>& params, const Domain& domain,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<Pinhole>> project_with_jacobians(const Params<Pinhole>& params,
                                                                                 const Domain& domain,
                                                                                 const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<Pinhole>& params, const Domain& domain,
                                                                const Eigen::Vector2d& px);
};

static_assert(CameraModel<Pinhole>);

ALIDADE_PUBLIC_END
}  // namespace alidade
