#pragma once

#include <deque>
#include <memory>
#include <string>

#include "alidade/heads/head_device.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A frame and when it was taken, by the run's clock.
struct StreamFrame {
  double t_s = 0.0;
  bool is_stamped = false;               ///< By who took it; else it is when it came.
  std::shared_ptr<const cv::Mat> image;  ///< 8 bits, grey or BGR.
};

/// Frames of a camera as they come. Throws InputError: nobody answers, no pictures, the stream is lost.
class FrameStream {
 public:
  virtual ~FrameStream() = default;
  /// Those that have come since the last call; never waits.
  [[nodiscard]] virtual std::deque<StreamFrame> take() = 0;
  [[nodiscard]] virtual const std::string& name() const = 0;
};

/// Where the camera is that a simulated head carries, and what it sees: a far world of noise.
struct SimulatedCamera {
  int width_px = 320, height_px = 240;
  double fx = 350.0, fy = 348.0, cx = 163.2, cy = 117.9, k1 = -0.08;
  Eigen::Vector3d mount_rad = Eigen::Vector3d::Zero();  ///< Rotation vector of cam_from_tilt.
  double fps = 12.0, delay_s = 0.0;                     ///< A frame stamped t shows the angle of t − delay_s.
  double noise = 1.5;
  /// A bright disc that goes to and fro about `target_rad` (pan, tilt) by `target_span_rad` of pan, at that rate; its
  /// radius zero: none.
  Eigen::Vector2d target_rad = Eigen::Vector2d::Zero();
  double target_rate_rad_s = 0.0, target_span_rad = 0.0, target_radius_rad = 0.0;
  std::uint64_t seed = 1;
};

/// "KEY=VALUE&…": size (WIDTHxHEIGHT), fx, fy, cx, cy, k1, mount (x:y:z in degrees), fps, delay, noise, seed, target
/// (rate:pan:tilt:span:radius in degrees). Throws InputError.
[[nodiscard]] SimulatedCamera simulated_camera(const std::string& text, const std::string& where);

/// Renders what such a camera sees at an angle of its head.
class CameraRenderer {
 public:
  explicit CameraRenderer(const SimulatedCamera& camera);
  ~CameraRenderer();
  [[nodiscard]] cv::Mat frame(const Eigen::Vector2d& pan_tilt_rad, std::uint64_t number, double t_s);

 private:
  struct World;
  SimulatedCamera camera_;
  std::unique_ptr<World> world_;
};

/// The stream of a URL: http://HOST:PORT/PATH (motion JPEG), sim://?… (what the simulated head's camera sees). Throws
/// InputError.
[[nodiscard]] std::unique_ptr<FrameStream> open_stream(const std::string& url, HeadDevice& head);

/// Motion JPEG over HTTP, read by a thread of its own: multipart/x-mixed-replace, each part a JPEG. X-Timestamp of a
/// part, seconds since 1970, is when it was taken.
[[nodiscard]] std::unique_ptr<FrameStream> open_mjpeg(const std::string& url, std::shared_ptr<HeadClock> clock);

}  // namespace alidade
