#include "alidade/camera/camera.h"

#include <cmath>

namespace alidade {
namespace {

template <CameraModel Model>
LensProjection for_any_lens(const Projection<Model>& projection) {
  return {projection.px, projection.J_px_point, projection.J_px_params};
}

}  // namespace

std::string_view model_name(const Lens& lens) {
  return std::visit([]<CameraModel Model>(const Calibrated<Model>&) { return Model::name; }, lens);
}

std::vector<std::string> param_names(const Lens& lens) {
  return std::visit(
      []<CameraModel Model>(const Calibrated<Model>&) {
        return std::vector<std::string>(Model::param_names.begin(), Model::param_names.end());
      },
      lens);
}

bool is_central(const Lens& lens) {
  return std::visit([]<CameraModel Model>(const Calibrated<Model>&) { return Model::is_central; }, lens);
}

Eigen::VectorXd params(const Lens& lens) {
  return std::visit([](const auto& calibrated) { return Eigen::VectorXd(calibrated.params); }, lens);
}

Lens with_params(const Lens& lens, const Eigen::VectorXd& values) {
  return std::visit([&]<CameraModel Model>(const Calibrated<Model>&) { return Lens(Calibrated<Model>{values}); }, lens);
}

Camera with_distortion(const Camera& camera) {
  if (!std::holds_alternative<Calibrated<Pinhole>>(camera.lens)) return camera;
  Camera wide = camera;
  const Eigen::VectorXd values = params(camera.lens);
  Eigen::VectorXd all = Eigen::VectorXd::Zero(Brown::num_params);
  all.head(values.size()) = values;
  wide.lens = with_params(Calibrated<Brown>{}, all);
  if (camera.cov.rows() != values.size()) return wide;
  wide.cov.setZero(all.size(), all.size());
  wide.cov.topLeftCorner(values.size(), values.size()) = camera.cov;
  return wide;
}

std::optional<Lens> make_lens(std::string_view model_name) {
  if (model_name == Pinhole::name) return Calibrated<Pinhole>{};
  if (model_name == Brown::name) return Calibrated<Brown>{};
  if (model_name == KannalaBrandt::name) return Calibrated<KannalaBrandt>{};
  if (model_name == FlatPort::name) return Calibrated<FlatPort>{};
  return std::nullopt;
}

std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) { return Model::project(lens.params, point_in_cam); },
      camera.lens);
}

std::vector<std::optional<Eigen::Vector2d>> project(const Camera& camera,
                                                    std::span<const Eigen::Vector3d> points_in_cam) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) {
        const typename Model::Domain domain = Model::domain(lens.params);
        std::vector<std::optional<Eigen::Vector2d>> pixels;
        pixels.reserve(points_in_cam.size());
        for (const Eigen::Vector3d& point : points_in_cam) {
          pixels.push_back(Model::project(lens.params, domain, point));
        }
        return pixels;
      },
      camera.lens);
}

std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Eigen::Vector2d& px) {
  return std::visit([&]<CameraModel Model>(const Calibrated<Model>& lens) { return Model::unproject(lens.params, px); },
                    camera.lens);
}

std::vector<std::optional<Eigen::Vector3d>> unproject(const Camera& camera, std::span<const Eigen::Vector2d> pixels) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) {
        const typename Model::Domain domain = Model::domain(lens.params);
        std::vector<std::optional<Eigen::Vector3d>> rays_in_cam;
        rays_in_cam.reserve(pixels.size());
        for (const Eigen::Vector2d& px : pixels) rays_in_cam.push_back(Model::unproject(lens.params, domain, px));
        return rays_in_cam;
      },
      camera.lens);
}

std::vector<std::optional<ObservationRay>> observation_rays(const Camera& camera,
                                                            std::span<const Eigen::Vector2d> pixels) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) {
        const typename Model::Domain domain = Model::domain(lens.params);
        std::vector<std::optional<ObservationRay>> rays(pixels.size());
        for (std::size_t i = 0; i < pixels.size(); ++i) {
          if constexpr (Model::is_central) {
            const auto direction_in_cam = Model::unproject(lens.params, domain, pixels[i]);
            if (direction_in_cam) rays[i] = ObservationRay{Eigen::Vector3d::Zero(), *direction_in_cam};
          } else {
            rays[i] = Model::observation_ray(lens.params, domain, pixels[i]);
          }
        }
        return rays;
      },
      camera.lens);
}

bool is_in_image(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= -0.5 && px.y() >= -0.5 && px.x() <= camera.width_px - 0.5 && px.y() <= camera.height_px - 0.5;
}

std::optional<ObservationRay> observation_ray(const Camera& camera, const Eigen::Vector2d& px) {
  return observation_rays(camera, {&px, 1}).front();
}

std::optional<Eigen::Vector3d> point_at_range(const ObservationRay& ray, double range_m) {
  // |o + s w|² = range²: the root in front.
  const double along = ray.origin_in_cam.dot(ray.direction_in_cam);
  const double square = along * along + range_m * range_m - ray.origin_in_cam.squaredNorm();
  const double distance_m = std::sqrt(square) - along;
  if (!(distance_m >= 0.0)) return std::nullopt;
  return ray.origin_in_cam + distance_m * ray.direction_in_cam;
}

std::optional<LensProjection> project_with_jacobians(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) -> std::optional<LensProjection> {
        const auto projection = Model::project_with_jacobians(lens.params, point_in_cam);
        if (!projection) return std::nullopt;
        return for_any_lens(*projection);
      },
      camera.lens);
}

std::vector<std::optional<LensProjection>> project_with_jacobians(const Camera& camera,
                                                                  std::span<const Eigen::Vector3d> points_in_cam) {
  return std::visit(
      [&]<CameraModel Model>(const Calibrated<Model>& lens) {
        const typename Model::Domain domain = Model::domain(lens.params);
        std::vector<std::optional<LensProjection>> projections(points_in_cam.size());
        for (std::size_t i = 0; i < points_in_cam.size(); ++i) {
          const auto projection = Model::project_with_jacobians(lens.params, domain, points_in_cam[i]);
          if (projection) projections[i] = for_any_lens(*projection);
        }
        return projections;
      },
      camera.lens);
}

}  // namespace alidade
