#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/localize/camera_motion.h"

namespace alidade {

/// Parametrisation of a feature in the state: its position, or its inverse distance along the ray of first observation.
enum class FeatureKind {
  xyz,            ///< y, 3 components [m]
  inverse_depth,  ///< c, θ, φ, ρ with y = c + m(θ, φ)/ρ, m = (cos φ sin θ, −sin φ, cos φ cos θ); ρ in 1/m
};

/// A point of the map. `values` are nominal; the error state is added to them.
/// J. Civera, A. J. Davison & J. M. M. Montiel, "Inverse Depth Parametrization for Monocular SLAM", TRO 24(5), 2008.
struct Feature {
  long id = 0;
  FeatureKind kind = FeatureKind::xyz;
  Eigen::Vector<double, 6> values = Eigen::Vector<double, 6>::Zero();  ///< For xyz only the first 3.
  bool is_known = false;  ///< A point of the target: these fix scale and frame.
  int offset = 0;         ///< Index of its first component in the state.
  /// For a known point: its given position and σ, and whether any of its observations was used.
  Eigen::Vector3d given_in_world = Eigen::Vector3d::Zero();
  double sigma_given_m = 0.0;
  bool was_used = false;

  [[nodiscard]] int dim() const { return kind == FeatureKind::xyz ? 3 : 6; }
};

/// m(θ, φ) and its derivatives.
struct BearingAngles {
  Eigen::Vector3d m, m_theta, m_phi;
};
[[nodiscard]] BearingAngles bearing_of(double theta, double phi);
/// θ, φ of a direction, and J = ∂(θ, φ)/∂direction.
struct AnglesOfBearing {
  double theta = 0.0, phi = 0.0;
  Eigen::Matrix<double, 2, 3> J;
};
[[nodiscard]] AnglesOfBearing angles_of(const Eigen::Vector3d& direction);

/// Position of a feature in the world and its derivative with respect to its components (the first dim() columns).
struct FeaturePlace {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix<double, 3, 6> J;
};
[[nodiscard]] FeaturePlace place_of(const Feature& feature);

/// Predicted observation of a feature, with Jacobians with respect to the camera's position and rotation error, the
/// feature's components and the lens: h_C = Rᵀ(y − r), ∂h_C/∂r = −Rᵀ, ∂h_C/∂δθ = [h_C]×, ∂h_C/∂y = Rᵀ.
struct ExpectedView {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 6> J_px_pose;
  Eigen::Matrix<double, 2, 6> J_px_feature;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> J_px_lens;
  double depth_m = 0.0;  ///< Along the optical axis.
};
/// Empty if the feature is behind the camera or outside the domain of the lens.
[[nodiscard]] std::optional<ExpectedView> expected_view(const Camera& camera, const Rigid3& world_from_cam,
                                                        const Feature& feature);

/// A feature initialised from one observation: on the ray of a pixel, at a distance given by a prior.
struct NewFeature {
  Feature feature;
  Eigen::Matrix<double, 6, 6> J_pose;                                     ///< W.r.t. position and rotation error.
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 16> J_lens;              ///< W.r.t. the lens parameters.
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< From pixel and distance only.
  Eigen::Vector<double, 6> J_range = Eigen::Vector<double, 6>::Zero();    ///< W.r.t. the relative distance.
};
/// Prior distance along the ray and its relative σ (that of the inverse distance, if that is in the state).
struct RangePrior {
  double range_m = 1.0;
  double sigma_rel = 0.5;
  bool is_of_map = false;  ///< Derived from other points of the map: it scales with the world.
};
/// Empty if the lens has no ray for the pixel.
[[nodiscard]] std::optional<NewFeature> new_feature(const Camera& camera, const Rigid3& world_from_cam,
                                                    const Eigen::Vector2d& px, double sigma_px, const RangePrior& prior,
                                                    FeatureKind kind);

/// Linearity index of the position of an inverse-depth feature in ρ, within its σ: 4 σ_d/d |cos α|, with
/// σ_d = σ_ρ/ρ², d the distance from the camera, α the parallax. Convert below 0.1. Civera et al. 2008, eq. (29).
[[nodiscard]] double linearity_index(const Feature& feature, double sigma_rho, const Eigen::Vector3d& camera_in_world);

}  // namespace alidade
