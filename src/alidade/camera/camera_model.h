#pragma once

#include <Eigen/Core>
#include <concepts>
#include <optional>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

template <class Model>
using Params = Eigen::Matrix<double, Model::num_params, 1>;

/// A pixel with its derivatives.
template <class Model>
struct Projection {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 3> J_px_point;                   ///< With respect to the point in the camera frame [px/m].
  Eigen::Matrix<double, 2, Model::num_params> J_px_params;  ///< With respect to the lens parameters, in their order.
};

/// Where a pixel looks outside the camera: all points origin_in_cam + distance · direction_in_cam, distance ≥ 0.
struct ObservationRay {
  Eigen::Vector3d origin_in_cam = Eigen::Vector3d::Zero();     ///< [m]; the centre of a central lens.
  Eigen::Vector3d direction_in_cam = Eigen::Vector3d::Zero();  ///< Unit.
};

/// A lens: pure functions of a parameter vector. No state, no base class; adding a model is adding one header and
/// one entry to `Lens`. Pixel (0, 0) is the CENTRE of the top-left pixel; camera axes are x right, y down, z forward.
/// `Domain` is what the parameters alone decide about the valid domain: compute it once with domain(), then project a
/// batch with the overloads that take it. The overloads without it are for single points.
/// The first five parameters of every model are fx, fy, cx, cy, skew [px]: (u, v) = (fx x + skew y + cx, fy y + cy)
/// of the distorted normalised point (x, y). No answer (nullopt) behind the camera or outside the valid domain.
/// `is_central`: all rays meet in the camera's origin, so that unproject() says all about a pixel. Of a model that is
/// not, it gives the direction alone; observation_ray() gives the whole ray.
template <class Model>
concept CameraModel = requires(const Params<Model>& params, const Eigen::Vector3d& point_in_cam,
                               const typename Model::Domain& domain, const Eigen::Vector2d& px) {
  { Model::name } -> std::convertible_to<std::string_view>;
  { Model::is_central } -> std::convertible_to<bool>;
  { Model::num_params } -> std::convertible_to<int>;
  { Model::param_names[0] } -> std::convertible_to<std::string_view>;
  { Model::domain(params) } -> std::same_as<typename Model::Domain>;
  { Model::project(params, point_in_cam) } -> std::same_as<std::optional<Eigen::Vector2d>>;
  { Model::project_with_jacobians(params, point_in_cam) } -> std::same_as<std::optional<Projection<Model>>>;
  { Model::project(params, domain, point_in_cam) } -> std::same_as<std::optional<Eigen::Vector2d>>;
  { Model::project_with_jacobians(params, domain, point_in_cam) } -> std::same_as<std::optional<Projection<Model>>>;
  { Model::unproject(params, px) } -> std::same_as<std::optional<Eigen::Vector3d>>;
  { Model::unproject(params, domain, px) } -> std::same_as<std::optional<Eigen::Vector3d>>;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
