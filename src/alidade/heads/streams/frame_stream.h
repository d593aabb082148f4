#pragma once

#include <deque>
#include <memory>
#include <string>

#include "alidade/board/board.h"
#include "alidade/heads/head_device.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Who says when a frame was taken.
enum class FrameTimes {
  arrival,  ///< Nobody: it is when it came, less what the network held it back.
  sender,   ///< RTCP's sender reports.
  stamped   ///< Who took it.
};

/// A frame and when it was taken, by the run's clock.
struct StreamFrame {
  double t_s = 0.0;
  FrameTimes times = FrameTimes::arrival;
  double sigma_s = 0.0;                  ///< Of t_s, but for what all frames are late alike.
  double came_s = 0.0;                   ///< When it was here.
  std::shared_ptr<const cv::Mat> image;  ///< 8 bits, grey or BGR.
};

/// Frames of a camera as they come. Throws InputError: nobody answers, no images, the stream is lost.
class FrameStream {
 public:
  virtual ~FrameStream() = default;
  /// Those that have come since the last call; never waits.
  [[nodiscard]] virtual std::deque<StreamFrame> take() = 0;
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Of images that are exposed one by one, as a telescope's are; 0: a video.
  [[nodiscard]] virtual double exposure_s() const { return 0.0; }
};

/// Where the camera is that a simulated head carries, and what it sees: a far world of noise.
struct SimulatedCamera {
  int width_px = 320, height_px = 240;
  double fx = 350.0, fy = 348.0, cx = 163.2, cy = 117.9, k1 = -0.08;
  Eigen::Vector3d mount_rad = Eigen::Vector3d::Zero();  ///< Rotation vector of cam_from_tilt.
  double fps = 12.0, delay_s = 0.0;                     ///< A frame stamped t shows the angle of t − delay_s.
  double noise = 1.5;
  double jump_s = 0.0;  ///< Time stamps go back and forth by it, for a second of each three.
  /// A bright disc that goes to and fro about `target_rad` (pan, tilt) by `target_span_rad` of pan, at that rate; its
  /// radius zero: none.
  Eigen::Vector2d target_rad = Eigen::Vector2d::Zero();
  double target_rate_rad_s = 0.0, target_span_rad = 0.0, target_radius_rad = 0.0;
  /// A chessboard that faces where the head looks at `board_rad` (pan, tilt), so far away; none: no columns.
  Board board = {.cols = 0, .rows = 0};
  double board_m = 1.0;
  Eigen::Vector2d board_rad = Eigen::Vector2d::Zero();
  std::uint64_t seed = 1;
};

/// "KEY=VALUE&…": size (WIDTHxHEIGHT), fx, fy, cx, cy, k1, mount (x:y:z in degrees), fps, delay, noise, seed, target
/// (rate:pan:tilt:span:radius in degrees), board (columns:rows:square:distance:pan:tilt in m and degrees), jump
/// (seconds by which its time stamps go wrong now and then). Throws InputError, which names all keys where one is not
/// known.
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

/// The time stamp of such a camera's frame of that time, as wrong as its `jump_s` makes it.
[[nodiscard]] double stamp_of(const SimulatedCamera& camera, double t_s);

/// The stream of a URL: http://HOST:PORT/PATH (motion JPEG), rtsp://…, v4l2:/dev/video0, onvif://… (the camera says
/// where), indi://HOST:PORT/DEVICE (a telescope's camera), sim://?… (what the simulated head's camera sees). {password}
/// in it stands for the password. Throws InputError, without it.
[[nodiscard]] std::unique_ptr<FrameStream> open_stream(const std::string& url, HeadDevice& head,
                                                       const HeadOptions& options = {});

/// Motion JPEG over HTTP, read by a thread of its own: multipart/x-mixed-replace, each part a JPEG. X-Timestamp of a
/// part, seconds since 1970, is when it was taken; `url` with {password} instead of it.
[[nodiscard]] std::unique_ptr<FrameStream> open_mjpeg(const std::string& url, const std::string& password,
                                                      std::shared_ptr<HeadClock> clock);

/// What the decoder beside this program reads: rtsp://, v4l2:, http:// of other kinds.
[[nodiscard]] std::unique_ptr<FrameStream> open_decoded(const std::string& url, const std::string& password,
                                                        std::shared_ptr<HeadClock> clock);

/// A camera behind INDI's server, which exposes one image after the other, each `?seconds=` long (1 if it is not
/// given).
[[nodiscard]] std::unique_ptr<FrameStream> open_indi_camera(const std::string& url, std::shared_ptr<HeadClock> clock);

/// `text` with the password where {password} stands. Throws InputError where there is none to put there.
[[nodiscard]] std::string with_secret(const std::string& text, const std::string& password);

}  // namespace alidade
