#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/files/json_value.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/live/protocol.h"

// Messages that Foxglove and Lichtblick draw, as JSON; their schemas are github.com/foxglove/foxglove-sdk/schemas.

namespace alidade::live {

enum class FoxgloveType {
  frame_transforms,
  pose_in_frame,
  scene_update,
  camera_calibration,
  compressed_image,
  image_annotations,
  log
};

/// A topic of that type, with its JSON Schema.
[[nodiscard]] Channel foxglove_channel(std::string topic, FoxgloveType type);

/// Red, green, blue, opacity, 0…1.
struct Colour {
  double r = 1.0, g = 1.0, b = 1.0, a = 1.0;
};
inline constexpr Colour blue{0.0, 0.45, 0.7, 1.0}, orange{0.9, 0.62, 0.0, 1.0}, vermilion{0.84, 0.37, 0.0, 1.0},
    sky{0.34, 0.71, 0.91, 1.0}, purple{0.8, 0.47, 0.65, 1.0}, grey{0.6, 0.65, 0.7, 1.0};

struct FrameTransform {
  std::string parent, child;
  Rigid3 parent_from_child;
};
[[nodiscard]] std::string frame_transforms_text(std::int64_t t_ns, std::span<const FrameTransform> transforms);
[[nodiscard]] std::string pose_text(std::int64_t t_ns, const std::string& frame, const Rigid3& frame_from_thing);
/// Upper-case D, K, R, P: plumb_bob (k1 k2 p1 p2 k3), kannala_brandt, or none. Of a flat port: as without distortion.
[[nodiscard]] std::string camera_calibration_text(std::int64_t t_ns, const std::string& frame, const Camera& camera);
[[nodiscard]] std::string compressed_image_text(std::int64_t t_ns, const std::string& frame, std::string_view jpeg);

enum class LogLevel { info = 2, warning = 3, error = 4 };
[[nodiscard]] std::string log_text(std::int64_t t_ns, LogLevel level, const std::string& name, const std::string& what);

/// Things in space, in one frame; a thing of the same name replaces the one before. Widths in px, lengths in m.
class Scene {
 public:
  Scene(std::int64_t t_ns, std::string frame) : t_ns_(t_ns), frame_(std::move(frame)) {}
  void line(const std::string& id, std::span<const Eigen::Vector3d> points, double width_px, const Colour& colour);
  /// Whose half-axes are 3σ of the covariance.
  void ellipsoid(const std::string& id, const Eigen::Vector3d& centre, const Eigen::Matrix3d& cov_m2,
                 const Colour& colour);
  void label(const std::string& id, const Eigen::Vector3d& at, const std::string& text);
  [[nodiscard]] std::string text() const;

 private:
  JsonValue entity(const std::string& id, const std::string& kind, JsonValue thing) const;

  std::int64_t t_ns_;
  std::string frame_;
  JsonValue entities_ = JsonValue::list();
};

/// Marks over an image. [px]
class Marks {
 public:
  explicit Marks(std::int64_t t_ns) : t_ns_(t_ns) {}
  void dot(const Eigen::Vector2d& px, double diameter_px, const Colour& colour);
  /// 3σ of the covariance.
  void ellipse(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& cov_px2, const Colour& colour);
  [[nodiscard]] std::string text() const;

 private:
  std::int64_t t_ns_;
  JsonValue circles_ = JsonValue::list(), lines_ = JsonValue::list();
};

}  // namespace alidade::live
