#pragma once

#include <array>

#include "alidade/camera/camera_model.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Kannala–Brandt fisheye: image radius θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), θ = angle off the optical axis,
/// (x_d, y_d) = θ_d/ρ (X, Y), ρ = |(X, Y)|. Same parameters and order of k as cv::fisheye; skew in px as everywhere.
/// Valid below max_angle(), where the radial map stops growing. Sees sideways and backwards (θ up to π).
/// Kannala & Brandt, PAMI 28(8), 2006, eq. (6).
struct KannalaBrandt {
  static constexpr std::string_view name = "kannala_brandt";
  static constexpr bool is_central = true;
  static constexpr int num_params = 9;
  static constexpr std::array<std::string_view, num_params> param_names{"fx", "fy", "cx", "cy", "skew",
                                                                        "k1", "k2", "k3", "k4"};

  /// Angle where the radial map folds. [rad]
  struct Domain {
    double max_angle = 0.0;
  };
  [[nodiscard]] static Domain domain(const Params<KannalaBrandt>& params);

  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<KannalaBrandt>& params,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<KannalaBrandt>> project_with_jacobians(
      const Params<KannalaBrandt>& params, const Eigen::Vector3d& point_in_cam);
  /// Unit ray of a pixel, in the camera frame. None where no angle of the valid domain is seen there.
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<KannalaBrandt>& params,
                                                                const Eigen::Vector2d& px);

  /// Smallest root θ in (0, π] of dθ_d/dθ; π where the map never folds. [rad]
  [[nodiscard]] static double max_angle(const Params<KannalaBrandt>& params);

  /// The same for a batch, with the domain computed once.
  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<KannalaBrandt>& params, const Domain& domain,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<KannalaBrandt>> project_with_jacobians(
      const Params<KannalaBrandt>& params, const Domain& domain, const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<KannalaBrandt>& params,
                                                                const Domain& domain, const Eigen::Vector2d& px);
};

static_assert(CameraModel<KannalaBrandt>);

ALIDADE_PUBLIC_END
}  // namespace alidade
