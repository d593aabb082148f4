#include "alidade/heads/streams/frame_stream.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/heads/protocols/onvif_head.h"
#include "alidade/heads/simulated_head.h"
#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/boards/board_placing.h"
#include "alidade/simulate/films/panorama_video.h"

namespace alidade {
namespace {

/// What the camera on a simulated head sees, taken when it is asked for.
class SimulatedStream final : public FrameStream {
 public:
  SimulatedStream(std::string url, const SimulatedCamera& camera, HeadPlant& plant, HeadClock& clock)
      : name_(std::move(url)), camera_(camera), renderer_(camera), plant_(plant), clock_(clock) {
    next_s_ = clock.now_s();
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::deque<StreamFrame> take() override {
    std::deque<StreamFrame> frames;
    const double now_s = clock_.now_s();
    if (now_s < next_s_) return frames;
    next_s_ = std::max(next_s_ + 1.0 / camera_.fps, now_s - 1.0 / camera_.fps);
    auto image = std::make_shared<cv::Mat>(renderer_.frame(plant_.truth(now_s), ++number_, now_s));
    frames.push_back({stamp_of(camera_, now_s), FrameTimes::stamped, 0.0, now_s, std::move(image)});
    return frames;
  }

 private:
  std::string name_;
  SimulatedCamera camera_;
  CameraRenderer renderer_;
  HeadPlant& plant_;
  HeadClock& clock_;
  double next_s_ = 0.0;
  std::uint64_t number_ = 0;
};

/// A disc, to a sixteenth of a pixel; the world around it dimmed, so that it is the brightest by far.
void draw_target(const SimulatedCamera& camera, const RotatingIntrinsics& k, const Eigen::Quaterniond& base_from_cam,
                 double t_s, cv::Mat& image) {
  constexpr int bits = 4;
  constexpr double dim = 0.5, one = 1 << bits;
  image *= dim;
  Eigen::Vector2d at = camera.target_rad;
  if (camera.target_span_rad > 0.0) {
    const double cycles = std::fmod(t_s * camera.target_rate_rad_s / camera.target_span_rad, 2.0);
    at[0] += camera.target_span_rad * ((cycles < 1.0 ? cycles : 2.0 - cycles) - 0.5);
  }
  const Eigen::Vector3d ray = base_from_cam.conjugate() *
                              (base_from_cam_rotation(Eigen::Vector3d(at[0], at[1], 0.0)) * Eigen::Vector3d::UnitZ());
  if (ray.z() < 0.2) return;
  const Eigen::Vector2d plane = ray.head<2>() / ray.z(), bent = plane * (1.0 + k.k1 * plane.squaredNorm());
  const Eigen::Vector2d px(k.fx * bent.x() + k.cx, k.fy * bent.y() + k.cy);
  if ((px.array().abs() > 4096.0).any()) return;
  cv::circle(image, cv::Point(static_cast<int>(std::lround(px.x() * one)), static_cast<int>(std::lround(px.y() * one))),
             static_cast<int>(std::lround(camera.target_radius_rad * k.fx * one)), cv::Scalar(255), cv::FILLED,
             cv::LINE_AA, bits);
}

/// A board that stands in front of the far world, as this camera sees it: the print and its rim.
void draw_board(const SimulatedCamera& simulated, const Eigen::Quaterniond& base_from_cam, std::uint64_t seed,
                cv::Mat& image) {
  Calibrated<Brown> lens;
  lens.params.head<6>() << simulated.fx, simulated.fy, simulated.cx, simulated.cy, 0.0, simulated.k1;
  BoardScene scene{{}, simulated.board, points_in_board(simulated.board), {}};
  scene.camera.width_px = simulated.width_px;
  scene.camera.height_px = simulated.height_px;
  scene.camera.lens = lens;
  const Eigen::Vector3d centre = 0.5 * (scene.points_in_board.front() + scene.points_in_board.back());
  const Eigen::Quaterniond cam_from_board =
      base_from_cam.conjugate() *
      base_from_cam_rotation(Eigen::Vector3d(simulated.board_rad[0], simulated.board_rad[1], 0.0));
  scene.cam_from_board.push_back(
      {cam_from_board, cam_from_board * (simulated.board_m * Eigen::Vector3d::UnitZ() - centre)});
  std::vector<cv::Point> outline, hull;
  for (const Eigen::Vector3d& point : visible_outline(scene)) {
    const auto px = project(scene.camera, scene.cam_from_board[0] * point);
    if (!px || px->cwiseAbs().maxCoeff() > 1e4) return;
    outline.emplace_back(static_cast<int>(std::lround(px->x())), static_cast<int>(std::lround(px->y())));
  }
  cv::Mat mask(image.size(), CV_8U, cv::Scalar(0));
  cv::convexHull(outline, hull);
  cv::fillConvexPoly(mask, hull, cv::Scalar(255));
  if (cv::countNonZero(mask) == 0) return;
  const RenderConfig config{.noise = simulated.noise, .background_texture = 0.0, .oversampling = 2};
  render_board_photo(scene, 0, config, seed).copyTo(image, mask);
}

std::vector<double> numbers_in(const std::string& text, const char* separators) {
  std::vector<double> numbers;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find_first_of(separators, at), text.size());
    const std::string part = text.substr(at, end - at);
    char* last = nullptr;
    const double number = std::strtod(part.c_str(), &last);
    if (part.empty() || *last != '\0' || !std::isfinite(number) || std::abs(number) > 1e6) return {};
    numbers.push_back(number);
    at = end + 1;
  }
  return numbers;
}

/// The words of a value, as "size=320x240", into the camera: false where there is no such.
bool take_shape(const std::string& key, const std::vector<double>& n, SimulatedCamera& camera) {
  const auto is_within = [](double value, double low, double high) { return value >= low && value <= high; };
  if (key == "size" && n.size() == 2 && is_within(n[0], 64, 4096) && is_within(n[1], 64, 4096)) {
    const double scale = n[0] / camera.width_px;
    camera.width_px = static_cast<int>(n[0]);
    camera.height_px = static_cast<int>(n[1]);
    for (double* each : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *each *= scale;
  } else if (key == "target" && n.size() == 5) {
    camera.target_rate_rad_s = n[0] * degree;
    camera.target_rad = Eigen::Vector2d(n[1], n[2]) * degree;
    camera.target_span_rad = n[3] * degree;
    camera.target_radius_rad = n[4] * degree;
  } else if (key == "board" && n.size() == 6 && is_within(n[0], 3, 40) && is_within(n[1], 3, 40) && n[2] > 0.0 &&
             n[3] > 0.0) {
    camera.board = {.cols = static_cast<int>(n[0]), .rows = static_cast<int>(n[1]), .square_m = n[2]};
    camera.board_m = n[3];
    camera.board_rad = Eigen::Vector2d(n[4], n[5]) * degree;
  } else if (key == "mount" && n.size() == 3) {
    camera.mount_rad = Eigen::Vector3d(n[0], n[1], n[2]) * degree;
  } else {
    return false;
  }
  return true;
}

}  // namespace

SimulatedCamera simulated_camera(const std::string& text, const std::string& where) {
  SimulatedCamera camera;
  double seed = 1.0;
  const std::map<std::string, double*> entries{
      {"fx", &camera.fx},       {"fy", &camera.fy},   {"cx", &camera.cx},       {"cy", &camera.cy},
      {"k1", &camera.k1},       {"fps", &camera.fps}, {"noise", &camera.noise}, {"delay", &camera.delay_s},
      {"jump", &camera.jump_s}, {"seed", &seed}};
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("&,", at), text.size());
    const std::string part = text.substr(at, end - at), key = part.substr(0, part.find('='));
    const std::vector<double> numbers =
        numbers_in(part.size() > key.size() ? part.substr(key.size() + 1) : "", key == "size" ? "x" : ":");
    at = end + 1;
    if (take_shape(key, numbers, camera)) continue;
    const auto entry = entries.find(key);
    if (entry == entries.end() || numbers.size() != 1)
      throw InputError(
          fmt::format("{}: '{}' is nothing that a simulated camera has; it has size=320x240, fx, fy, cx, "
                      "cy, k1, mount=X:Y:Z, fps, delay, noise, jump, target=RATE:PAN:TILT:SPAN:RADIUS, "
                      "board=COLUMNS:ROWS:SQUARE:DISTANCE:PAN:TILT, seed",
                      where, part));
    *entry->second = numbers[0];
  }
  camera.seed = static_cast<std::uint64_t>(std::abs(seed));
  if (!(camera.fx > 10.0 && camera.fy > 10.0 && camera.fps > 0.1 && camera.noise >= 0.0 && camera.noise < 100.0 &&
        std::abs(camera.k1) < 0.5))
    throw InputError(where + ": no such camera can be made");
  return camera;
}

struct CameraRenderer::World {
  FarWorld far;
};

CameraRenderer::CameraRenderer(const SimulatedCamera& camera)
    : camera_(camera),
      world_(std::make_unique<World>(World{FarWorld::of_noise(3.0 / std::min(camera.fx, camera.fy), camera.seed)})) {}
CameraRenderer::~CameraRenderer() = default;

cv::Mat CameraRenderer::frame(const Eigen::Vector2d& pan_tilt_rad, std::uint64_t number, double t_s) {
  const RotatingIntrinsics k{camera_.fx, camera_.fy, camera_.cx, camera_.cy, camera_.k1};
  const Eigen::Quaterniond base_from_cam =
      base_from_cam_rotation(Eigen::Vector3d(pan_tilt_rad[0], pan_tilt_rad[1], 0.0)) *
      exp_so3(camera_.mount_rad).conjugate();
  const PanoramaConfig config{.blur_px = 0.6, .noise = camera_.noise, .oversampling = 1};
  cv::Mat image = render_panorama(world_->far, k, camera_.width_px, camera_.height_px, base_from_cam, config,
                                  camera_.seed + 0x9e3779b97f4a7c15u * number);
  if (camera_.board.cols > 0) draw_board(camera_, base_from_cam, camera_.seed + number, image);
  if (camera_.target_radius_rad > 0.0) draw_target(camera_, k, base_from_cam, t_s, image);
  return image;
}

double stamp_of(const SimulatedCamera& camera, double t_s) {
  constexpr double period_s = 3.0;
  const double jump_s = std::fmod(t_s, period_s) < 1.0 ? camera.jump_s : 0.0;
  return t_s + camera.delay_s - jump_s;
}

std::string with_secret(const std::string& text, const std::string& password) {
  constexpr std::string_view mark = "{password}";
  std::string filled = text;
  const std::size_t at = filled.find(mark);
  if (at == std::string::npos) return filled;
  if (password.empty()) throw InputError(text + ": no password was given: --password-file, or ALIDADE_PASSWORD");
  return filled.replace(at, mark.size(), password);
}

namespace {

/// What others could read shall not be a password.
void refuse_secrets(const std::string& url) {
  const std::string shown = url.substr(0, url.find_first_of("@?"));
  const std::size_t begin = url.find("://"), at = url.find('@');
  const bool names_password = begin != std::string::npos && at != std::string::npos && url.find(':', begin + 3) < at;
  std::string lower = url;
  for (char& letter : lower) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  bool has_word = false;
  for (const char* word : {"pwd=", "pass=", "password=", "passwd="}) {
    const std::size_t found = lower.find(word);
    has_word =
        has_word || (found != std::string::npos && !lower.substr(found).starts_with(std::string(word) + "{password}"));
  }
  if (names_password || has_word)
    throw InputError(
        (names_password ? url.substr(0, begin + 3) : shown) +
        "…: no password may be in an address, where others can read it; give USER@HOST or {password} in its "
        "place, and the password by --password-file or in ALIDADE_PASSWORD");
}

}  // namespace

std::unique_ptr<FrameStream> open_stream(const std::string& url, HeadDevice& head, const HeadOptions& options) {
  refuse_secrets(url);
  const auto clock = std::shared_ptr<HeadClock>(std::shared_ptr<void>(), &head.clock());
  if (url.starts_with("http://")) return open_mjpeg(url, options.password, clock);
  if (url.starts_with("rtsp://") || url.starts_with("v4l2:") || url.starts_with("https://"))
    return open_decoded(url, options.password, clock);
  if (url.starts_with("indi://")) return open_indi_camera(url, clock);
  if (url.starts_with("onvif://")) return open_stream(onvif_stream_url(url, options), head, options);
  if (url.starts_with("sim://")) {
    HeadPlant* plant = plant_of(head);
    if (plant == nullptr) throw InputError(url + ": only a simulated head, sim://, carries such a camera");
    const std::size_t query = url.find('?');
    const std::string text = query == std::string::npos ? "" : url.substr(query + 1);
    return std::make_unique<SimulatedStream>(url, simulated_camera(text, url), *plant, head.clock());
  }
  throw InputError("'" + url +
                   "' is no stream of a head: give http://HOST:PORT/PATH (motion JPEG), rtsp://…, "
                   "v4l2:/dev/video0, onvif://…, indi://HOST:PORT/CAMERA or sim://");
}

}  // namespace alidade
