#pragma once

#include "alidade/camera/brown.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A Brown lens in air behind a flat port: air gap d, glass of thickness t with index n_g, then water with index n_w,
/// the port's unit normal n = (normal_x, normal_y, √(1 − normal_x² − normal_y²)) away from the camera. A point P in
/// water, at height z = n·P over the lens' centre and ρ = |P − z n| off the axis n, is seen under the angle θ to n in
/// air with τ = tan θ:
///     ρ = d τ + t τ / √(n_g² + (n_g² − 1) τ²) + (z − d − t) τ / √(n_w² + (n_w² − 1) τ²)
/// (Snell's law in each layer: sin θ = n_g sin θ_g = n_w sin θ_w), whose right side grows with τ and is concave, and at
/// the pixel of the air direction n + τ (P − z n)/ρ in the Brown lens. Agrawal et al., "A theory of multi-layer flat
/// refractive geometry", CVPR 2012, for the axis; docs/maths/camera-models.md.
/// NOT central: the rays in water do not meet in a point, so a direction alone says not all: see observation_ray().
/// Valid for z > d + t (in water), t ≥ 0, indices in [1, 4], and where the Brown lens sees the air direction.
/// A gap a little below zero is no port, but lets an estimate of one at zero scatter to both sides.
struct FlatPort {
  static constexpr std::string_view name = "flat_port";
  static constexpr bool is_central = false;
  static constexpr int num_params = 16;
  static constexpr std::array<std::string_view, num_params> param_names{
      "fx", "fy", "cx",    "cy",      "skew",    "k1",      "k2",       "p1",
      "p2", "k3", "gap_m", "glass_m", "n_glass", "n_water", "normal_x", "normal_y"};

  static constexpr double min_gap_m = -0.03;

  /// That of the lens in air.
  using Domain = Brown::Domain;
  [[nodiscard]] static Domain domain(const Params<FlatPort>& params);

  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<FlatPort>& params,
                                                              const Eigen::Vector3d& point_in_cam);
  /// By the implicit function theorem.
  [[nodiscard]] static std::optional<Projection<FlatPort>> project_with_jacobians(const Params<FlatPort>& params,
                                                                                  const Eigen::Vector3d& point_in_cam);
  /// Unit DIRECTION in water of what a pixel sees, in the camera frame; the ray does not begin at the lens' centre.
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<FlatPort>& params,
                                                                const Eigen::Vector2d& px);
  /// The ray in water: it begins where it leaves the port's outer face.
  [[nodiscard]] static std::optional<ObservationRay> observation_ray(const Params<FlatPort>& params,
                                                                     const Domain& domain, const Eigen::Vector2d& px);

  /// The port's unit normal, away from the camera; NaN where normal_x, normal_y are of no unit vector.
  [[nodiscard]] static Eigen::Vector3d normal(const Params<FlatPort>& params);
  /// The lens in air.
  [[nodiscard]] static Params<Brown> air_lens(const Params<FlatPort>& params);

  /// The same for a batch, with the domain computed once.
  [[nodiscard]] static std::optional<Eigen::Vector2d> project(const Params<FlatPort>& params, const Domain& domain,
                                                              const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Projection<FlatPort>> project_with_jacobians(const Params<FlatPort>& params,
                                                                                  const Domain& domain,
                                                                                  const Eigen::Vector3d& point_in_cam);
  [[nodiscard]] static std::optional<Eigen::Vector3d> unproject(const Params<FlatPort>& params, const Domain& domain,
                                                                const Eigen::Vector2d& px);
};

static_assert(CameraModel<FlatPort>);

ALIDADE_PUBLIC_END
}  // namespace alidade
