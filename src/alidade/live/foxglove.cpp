#include "alidade/live/foxglove.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/report/markup.h"

namespace alidade::live {
namespace {

JsonValue stamp(std::int64_t t_ns) {
  constexpr std::int64_t ns_in_s = 1'000'000'000;
  const std::int64_t t = std::max<std::int64_t>(0, t_ns);
  JsonValue value = JsonValue::object();
  value["sec"] = t / ns_in_s;
  value["nsec"] = t % ns_in_s;
  return value;
}

JsonValue xyz(const Eigen::Vector3d& v) {
  JsonValue value = JsonValue::object();
  value["x"] = v.x();
  value["y"] = v.y();
  value["z"] = v.z();
  return value;
}

JsonValue xyzw(const Eigen::Quaterniond& q) {
  JsonValue value = xyz(q.vec());
  value["w"] = q.w();
  return value;
}

JsonValue pose(const Rigid3& rigid) {
  JsonValue value = JsonValue::object();
  value["position"] = xyz(rigid.translation);
  value["orientation"] = xyzw(rigid.rotation);
  return value;
}

JsonValue rgba(const Colour& colour) {
  JsonValue value = JsonValue::object();
  value["r"] = colour.r;
  value["g"] = colour.g;
  value["b"] = colour.b;
  value["a"] = colour.a;
  return value;
}

/// By name; 0 where the lens has no such parameter.
double param(const Camera& camera, std::string_view name) {
  const std::vector<std::string> names = param_names(camera.lens);
  const auto at = std::ranges::find(names, name);
  return at == names.end() ? 0.0 : params(camera.lens)[at - names.begin()];
}

}  // namespace

std::string frame_transforms_text(std::int64_t t_ns, std::span<const FrameTransform> transforms) {
  JsonValue value = JsonValue::object();
  value["transforms"] = JsonValue::list();
  for (const FrameTransform& transform : transforms) {
    JsonValue one = JsonValue::object();
    one["timestamp"] = stamp(t_ns);
    one["parent_frame_id"] = transform.parent;
    one["child_frame_id"] = transform.child;
    one["translation"] = xyz(transform.parent_from_child.translation);
    one["rotation"] = xyzw(transform.parent_from_child.rotation);
    value["transforms"].push_back(std::move(one));
  }
  return value.text();
}

std::string pose_text(std::int64_t t_ns, const std::string& frame, const Rigid3& frame_from_thing) {
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns);
  value["frame_id"] = frame;
  value["pose"] = pose(frame_from_thing);
  return value.text();
}

std::string camera_calibration_text(std::int64_t t_ns, const std::string& frame, const Camera& camera) {
  const double fx = param(camera, "fx"), fy = param(camera, "fy"), cx = param(camera, "cx"), cy = param(camera, "cy");
  const double skew = param(camera, "skew");
  std::vector<double> d;
  std::string model;
  const auto take = [&](std::string name, std::initializer_list<const char*> parameters) {
    model = std::move(name);
    for (const char* parameter : parameters) d.push_back(param(camera, parameter));
  };
  if (model_name(camera.lens) == "brown") take("plumb_bob", {"k1", "k2", "p1", "p2", "k3"});
  if (model_name(camera.lens) == "kannala_brandt") take("kannala_brandt", {"k1", "k2", "k3", "k4"});
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns);
  value["frame_id"] = frame;
  value["width"] = camera.width_px;
  value["height"] = camera.height_px;
  value["distortion_model"] = model;
  value["D"] = d;
  value["K"] = std::vector<double>{fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0};
  value["R"] = std::vector<double>{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  value["P"] = std::vector<double>{fx, skew, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0};
  return value.text();
}

std::string compressed_image_text(std::int64_t t_ns, const std::string& frame, std::string_view jpeg) {
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns);
  value["frame_id"] = frame;
  value["data"] = report::base64(jpeg);
  value["format"] = "jpeg";
  return value.text();
}

std::string log_text(std::int64_t t_ns, LogLevel level, const std::string& name, const std::string& what) {
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns);
  value["level"] = static_cast<int>(level);
  value["message"] = what;
  value["name"] = name;
  value["file"] = "";
  value["line"] = 0;
  return value.text();
}

/// Every list of an entity is required, empty where unused.
JsonValue Scene::entity(const std::string& id, const std::string& kind, JsonValue thing) const {
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns_);
  value["frame_id"] = frame_;
  value["id"] = id;
  value["lifetime"] = stamp(0);
  value["frame_locked"] = true;
  value["metadata"] = JsonValue::list();
  for (const char* name : {"arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models"})
    value[name] = JsonValue::list();
  value[kind].push_back(std::move(thing));
  return value;
}

void Scene::line(const std::string& id, std::span<const Eigen::Vector3d> points, double width_px,
                 const Colour& colour) {
  constexpr int line_strip = 0;
  JsonValue value = JsonValue::object();
  value["type"] = line_strip;
  value["pose"] = pose({});
  value["thickness"] = width_px;
  value["scale_invariant"] = true;
  value["points"] = JsonValue::list();
  for (const Eigen::Vector3d& point : points) value["points"].push_back(xyz(point));
  value["color"] = rgba(colour);
  value["colors"] = JsonValue::list();
  value["indices"] = JsonValue::list();
  entities_.push_back(entity(id, "lines", std::move(value)));
}

void Scene::ellipsoid(const std::string& id, const Eigen::Vector3d& centre, const Eigen::Matrix3d& cov_m2,
                      const Colour& colour) {
  const SymmetricEigen3 axes = symmetric_eigen3(cov_m2);
  Eigen::Matrix3d rotation = axes.vectors;
  if (rotation.determinant() < 0.0) rotation.col(0) = -rotation.col(0);
  JsonValue value = JsonValue::object();
  value["pose"] = pose({Eigen::Quaterniond(rotation), centre});
  value["size"] = xyz(6.0 * axes.values.cwiseMax(0.0).cwiseSqrt());  // full axes
  value["color"] = rgba(colour);
  entities_.push_back(entity(id, "spheres", std::move(value)));
}

void Scene::label(const std::string& id, const Eigen::Vector3d& at, const std::string& text) {
  JsonValue value = JsonValue::object();
  value["pose"] = pose({Eigen::Quaterniond::Identity(), at});
  value["billboard"] = true;
  value["font_size"] = 14.0;
  value["scale_invariant"] = true;
  value["color"] = rgba(grey);
  value["text"] = text;
  entities_.push_back(entity(id, "texts", std::move(value)));
}

std::string Scene::text() const {
  JsonValue value = JsonValue::object();
  value["deletions"] = JsonValue::list();
  value["entities"] = entities_;
  return value.text();
}

namespace {

JsonValue xy(const Eigen::Vector2d& v) {
  JsonValue value = JsonValue::object();
  value["x"] = v.x();
  value["y"] = v.y();
  return value;
}

}  // namespace

void Marks::dot(const Eigen::Vector2d& px, double diameter_px, const Colour& colour) {
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns_);
  value["position"] = xy(px);
  value["diameter"] = diameter_px;
  value["thickness"] = 1.0;
  value["fill_color"] = rgba(colour);
  value["outline_color"] = rgba(colour);
  circles_.push_back(std::move(value));
}

void Marks::ellipse(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& cov_px2, const Colour& colour) {
  constexpr int num_points = 36, line_loop = 2;
  const SymmetricEigen axes = symmetric_eigen(cov_px2);
  const Eigen::Matrix2d half = 3.0 * axes.vectors * axes.values.cwiseMax(0.0).cwiseSqrt().asDiagonal().toDenseMatrix();
  JsonValue value = JsonValue::object();
  value["timestamp"] = stamp(t_ns_);
  value["type"] = line_loop;
  value["points"] = JsonValue::list();
  for (int i = 0; i < num_points; ++i) {
    const double turn = 2.0 * 3.14159265358979 * i / num_points;
    value["points"].push_back(xy(centre_px + half * Eigen::Vector2d(std::cos(turn), std::sin(turn))));
  }
  value["outline_color"] = rgba(colour);
  value["outline_colors"] = JsonValue::list();
  value["fill_color"] = rgba({colour.r, colour.g, colour.b, 0.0});
  value["thickness"] = 2.0;
  lines_.push_back(std::move(value));
}

std::string Marks::text() const {
  JsonValue value = JsonValue::object();
  value["circles"] = circles_;
  value["points"] = lines_;
  value["texts"] = JsonValue::list();
  return value.text();
}

}  // namespace alidade::live
