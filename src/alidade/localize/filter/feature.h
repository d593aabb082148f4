#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/localize/camera_motion.h"

namespace alidade {

/// How a feature stands in the state: its position, or the inverse distance along the ray on which it was first seen.
enum class FeatureKind {
  xyz,            ///< y, 3 components [m]
  inverse_depth,  ///< c, θ, φ, ρ with y = c + m(θ, φ)/ρ, m = (cos φ sin θ, −sin φ, cos φ cos θ); ρ in 1/m
};

/// A point of the map. Its components are nominal values; the error is added to them.
/// J. Civera, A. J. Davison & J. M. M. Montiel, "Inverse Depth Parametrization for Monocular SLAM", TRO 24(5), 2008.
struct Feature {
  long id = 0;
  FeatureKind kind = FeatureKind::xyz;
  Eigen::Vector<double, 6> values = Eigen::Vector<double, 6>::Zero();  ///< The first 3 of xyz.
  bool is_known = false;  ///< One of the target's, which give scale and frame.
  int offset = 0;         ///< Where its components begin in the state.
  /// Of a known point: as it was given, and whether any of its observations was used.
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
/// θ, φ of a direction, and their derivatives by it.
struct AnglesOfBearing {
  double theta = 0.0, phi = 0.0;
  Eigen::Matrix<double, 2, 3> J;
};
[[nodiscard]] AnglesOfBearing angles_of(const Eigen::Vector3d& direction);

/// Position of a feature in the world and its derivative by its components (the first dim() columns).
struct FeaturePlace {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix<double, 3, 6> J;
};
[[nodiscard]] FeaturePlace place_of(const Feature& feature);

/// What a camera expects to see of a feature, with derivatives by position and rotation error, by the feature's
/// components and by the lens: h_C = Rᵀ(y − r), ∂h_C/∂r = −Rᵀ, ∂h_C/∂δθ = [h_C]×, ∂h_C/∂y = Rᵀ.
struct ExpectedView {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 6> J_px_pose;
  Eigen::Matrix<double, 2, 6> J_px_feature;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> J_px_lens;
  double depth_m = 0.0;  ///< Along the optical axis.
};
/// None behind the camera or outside the lens's domain.
[[nodiscard]] std::optional<ExpectedView> expected_view(const Camera& camera, const Rigid3& world_from_cam,
                                                        const Feature& feature);

/// A feature as first seen: on the ray of a pixel, its distance known by a prior.
struct NewFeature {
  Feature feature;
  Eigen::Matrix<double, 6, 6> J_pose;                                     ///< By position and rotation error.
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 16> J_lens;              ///< By the lens's parameters.
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< Of pixel and distance alone.
  Eigen::Vector<double, 6> J_range = Eigen::Vector<double, 6>::Zero();    ///< By the distance, relative.
};
/// Distance along the ray, and its σ over it (of the inverse distance, where that is the state).
struct RangePrior {
  double range_m = 1.0;
  double sigma_rel = 0.5;
  bool is_of_map = false;  ///< As far as other points of the map: larger where the world's scale is larger.
};
/// None where the lens sees nothing at the pixel.
[[nodiscard]] std::optional<NewFeature> new_feature(const Camera& camera, const Rigid3& world_from_cam,
                                                    const Eigen::Vector2d& px, double sigma_px, const RangePrior& prior,
                                                    FeatureKind kind);

/// How far the position of an inverse-depth feature is from linear in ρ within its σ: 4 σ_d/d |cos α|, with
/// σ_d = σ_ρ/ρ², d the distance from here, α the parallax. Convert below 0.1. Civera et al. 2008, eq. (29).
[[nodiscard]] double linearity_index(const Feature& feature, double sigma_rho, const Eigen::Vector3d& camera_in_world);

}  // namespace alidade
