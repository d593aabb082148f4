#pragma once

#include <array>

#include "alidade/camera/camera_model.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Perspective camera with radial and tangential distortion (Brown–Conrady), in OpenCV's names and order of k1…k3:
///     x = X/Z, y = Y/Z, r² = x² + y²,  L = 1 + k1 r² + k2 r⁴ + k3 r⁶
///     x_d = L x + 2 p1 x y + p2 (r² + 2x²),   y_d = L y + p1 (r² + 2y²) + 2 p2 x y
///     u = fx x_d + skew y_d + cx,             v = fy y_d + cy
/// Valid for Z > 0, r < max_radius() — there the radial map r·L(r²) stops growing and points would re-enter the image
/// — and det ∂(x_d, y_d)/∂(x, y) > 0, because the tangential terms move the fold inwards on one side. D. C. Brown,
/// "Close-range camera calibration", Photogrammetric Engineering 37(8), 1971.
struct Brown {
  static constexpr std::string_view name = "brown";
  static constexpr bool is_central = true;
  static constexpr int num_params = 10;
  static constexpr std::array<std::string_view, num_params> param_names{"fx", "fy", "cx", "cy", "skew",
                                                                        "k1", "k2", "p1", "p2", "k3"};

  /// Radius where the radial map folds, squared.
  struct Domain {
    double max_radius2 = 0.0;
  };
  [[nodiscard]] static Domain domain(const Params<Brown>& params);

  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<Brown>& params,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<Brown>> project_with_jacobians(const Params<Brown>& params,
                                                                               const Eigen::Vector3d& point_in_cam);
  /// Unit ray of a pixel, in the camera frame. None where no point of the valid domain is seen there.
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<Brown>& params, const Eigen::Vector2d& px);

  /// Smallest positive root r of d(rL)/dr = 1 + 3k1 r² + 5k2 r⁴ + 7k3 r⁶; infinity where the map never folds.
  [[nodiscard]] static double max_radius(const Params<Brown>& params);

  /// The same for a batch, with the domain computed once.
  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<Brown>& params, const Domain& domain,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<Brown>> project_with_jacobians(const Params<Brown>& params,
                                                                               const Domain& domain,
                                                                               const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<Brown>& params, const Domain& domain,
                                                                const Eigen::Vector2d& px);
};

static_assert(CameraModel<Brown>);

ALIDADE_PUBLIC_END
}  // namespace alidade
