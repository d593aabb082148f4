#include "alidade/heads/calibration/head_shots.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/calibration/calibration_log.h"
#include "alidade/heads/calibration/stars.h"
#include "alidade/heads/turn_log.h"
#include "alidade/tables/rotation_log_file.h"

namespace alidade {
namespace {

/// Where the image centre goes, in shares of its width and height.
constexpr std::array<std::array<double, 2>, 13> first_offsets{{{0, 0},
                                                               {0.35, 0},
                                                               {-0.35, 0},
                                                               {0, 0.35},
                                                               {0, -0.35},
                                                               {0.3, 0.3},
                                                               {-0.3, 0.3},
                                                               {-0.3, -0.3},
                                                               {0.3, -0.3},
                                                               {0.45, 0.2},
                                                               {-0.45, -0.2},
                                                               {-0.2, 0.45},
                                                               {0.2, -0.45}}};

class ShotSession {
 public:
  ShotSession(MovingHead& head, FrameStream& stream, const HeadCalibrationConfig& config, const Progress& progress,
              HeadCalibration& result)
      : head_(head), stream_(stream), config_(config), progress_(progress), result_(result) {
    head_.on_reading = [this](const HeadPosition& reading) { reading_ = reading; };
  }
  ~ShotSession() { head_.on_reading = nullptr; }
  ShotSession(const ShotSession&) = delete;
  ShotSession& operator=(const ShotSession&) = delete;

  void run() {
    begin_s_ = still_since_s_ = head_.now_s();
    result_.is_of_shots = true;
    try {
      watch(0.5);
      learn_scale();
      go_round();
      head_.stop();
    } catch (const InputError& fault) {  // a link is lost: the head first, then what was measured before is kept
      stop_anyhow();
      if (shots_.size() < 4) throw;
      result_.fault = fault.what();
    }
    result_.head_time_s = head_time();
    estimate();
  }

 private:
  struct Shot {
    double t_s = 0.0;
    Eigen::Vector2d pan_tilt_rad;
    std::vector<TrackedPoint> stars;
  };

  void stop_anyhow() {
    try {
      head_.stop();
    } catch (const InputError&) {  // it is the head that is lost
    }
  }
  [[nodiscard]] double head_time() { return head_.now_s() - begin_s_; }
  /// For another move, its rest and its image.
  [[nodiscard]] bool has_time() { return head_time() < config_.max_s - 3.0 - 2.0 * stream_.exposure_s(); }
  [[nodiscard]] Eigen::Vector2d at() const { return reading_.pan_tilt_rad; }

  void watch(double seconds) {
    constexpr double question_s = 0.1;
    for (const double until_s = head_.now_s() + seconds; head_.now_s() < until_s;) {
      report_progress(progress_, "calibrating: images", shots_.size(), 0);
      head_.wait_until(std::min(until_s, head_.now_s() + question_s));
      (void)head_.position();
    }
  }

  void move_to(const Eigen::Vector2d& target) {
    constexpr double rest_s = 1.0, min_s = 0.5, max_s = 60.0, still_rad = 5e-6;
    ++result_.num_moves;
    head_.command(target.cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad()));
    const double begin_s = head_.now_s();
    still_since_s_ = begin_s + min_s;
    Eigen::Vector2d before = at();
    while (head_.now_s() - begin_s < max_s && head_.now_s() - still_since_s_ < rest_s) {
      watch(0.1);
      if ((at() - before).norm() > still_rad) still_since_s_ = std::max(still_since_s_, head_.now_s());
      before = at();
    }
  }

  /// An image whose exposure began after the head had come to rest; its stars are found again, or it is left.
  void shoot() {
    constexpr double download_s = 20.0;
    const double exposure_s = stream_.exposure_s(), asked_s = head_.now_s();
    for (;;) {
      for (const StreamFrame& frame : stream_.take()) {
        ++result_.num_frames;
        if (frame.t_s - 0.5 * exposure_s < still_since_s_) continue;
        take(frame);
        return;
      }
      if (head_.now_s() - asked_s > 3.0 * exposure_s + download_s)
        throw InputError(stream_.name() + ": no image arrives; the stream is lost");
      watch(0.1);
    }
  }
  void take(const StreamFrame& frame) {
    result_.width_px = frame.image->cols;
    result_.height_px = frame.image->rows;
    result_.times = frame.times;
    result_.sigma_frame_s = frame.sigma_s;
    cv::Mat grey = *frame.image;
    if (grey.channels() == 3) cv::cvtColor(*frame.image, grey, cv::COLOR_BGR2GRAY);
    std::vector<TrackedPoint> stars = tracks_.update(find_stars(grey), at());
    is_found_ = !stars.empty();
    if (is_found_) shots_.push_back({frame.t_s - begin_s_, at(), std::move(stars)});
    tell_so_far();
  }

  /// How the image moves with each axis, by steps that grow until they can be measured.
  void learn_scale() {
    shoot();
    const Eigen::Vector2d start = at();
    double step_rad = 0.02 * degree;
    px_by_rad_.col(0) = way_of(0, start, step_rad);
    px_by_rad_.col(1) = way_of(1, at(), step_rad);
    if (px_by_rad_.determinant() < 0.0)
      throw InputError(stream_.name() + ": its image is mirrored against the head's axes");
    const double focal_px = px_by_rad_.col(1).norm();
    if (is_narrow(result_, focal_px)) result_.narrow_focal_px = std::round(focal_px);
    centre_ = start;
  }
  Eigen::Vector2d way_of(int axis, const Eigen::Vector2d& from, double& step_rad) {
    constexpr double enough_px = 30.0, max_rad = 8.0 * degree, more = 3.0;
    for (; step_rad < max_rad; step_rad *= more) {
      const Eigen::Vector2d before = at();
      Eigen::Vector2d target = from;
      target[axis] += from[axis] + step_rad <= head_.high_rad()[axis] ? step_rad : -step_rad;
      if (!has_time()) break;
      move_to(target);
      shoot();
      const auto shift = is_found_ ? tracks_.last_shift() : std::nullopt;
      if (!shift) break;
      const double turned = at()[axis] - before[axis];
      if (shift->shift_px.norm() >= enough_px && std::abs(turned) > 1e-7) return shift->shift_px / turned;
    }
    throw InputError(fmt::format("{}: the stars of one image are not found in the next ({} are seen), {:.2g}° away",
                                 stream_.name(), shots_.empty() ? 0 : shots_.back().stars.size(), step_rad / degree));
  }

  void go_round() {
    constexpr std::size_t min_shots = 10, every = 4;
    for (std::size_t i = 0; has_time(); ++i) {
      move_to(centre_ + px_by_rad_.inverse() * offset(i));
      shoot();
      if (shots_.size() < min_shots || i % every != 0 || !config_.until) continue;
      estimate();
      if (is_reached()) break;
    }
  }
  /// The first by the table, the others evenly by two irrational steps.
  [[nodiscard]] Eigen::Vector2d offset(std::size_t i) const {
    const Eigen::Vector2d size(result_.width_px, result_.height_px);
    if (i < first_offsets.size()) return size.cwiseProduct(Eigen::Vector2d(first_offsets[i][0], first_offsets[i][1]));
    constexpr double reach = 0.9;
    const double n = static_cast<double>(i), x = std::fmod(0.7548776662 * n, 1.0), y = std::fmod(0.5698402910 * n, 1.0);
    return reach * size.cwiseProduct(Eigen::Vector2d(x - 0.5, y - 0.5));
  }
  [[nodiscard]] bool is_reached() const {
    for (std::size_t i = 0; i < 2 && i < result_.report.quantities.size(); ++i) {
      const ObservedQuantity& f = result_.report.quantities[i];
      if (!(3.0 * f.sigma < *config_.until * f.value)) return false;
    }
    return result_.report.quantities.size() >= 2;
  }

  [[nodiscard]] std::string log_text() const {
    constexpr std::size_t min_rows = 2;
    std::map<int, std::size_t> columns;
    for (const Shot& shot : shots_)
      for (const TrackedPoint& star : shot.stars) ++columns[star.id];
    std::erase_if(columns, [](const auto& each) { return each.second < min_rows; });
    std::size_t next = 0;
    for (auto& [id, column] : columns) column = next++;
    RotationLog log;
    log.source = RotationSource::head;
    log.num_points = columns.size();
    for (const Shot& shot : shots_) {
      RotationRow row;
      row.t_s = shot.t_s;
      row.pan_tilt_roll_rad = Eigen::Vector3d(shot.pan_tilt_rad[0], shot.pan_tilt_rad[1], 0.0);
      row.px.assign(columns.size(), Eigen::Vector2d::Constant(not_seen));
      for (const TrackedPoint& star : shot.stars)
        if (const auto column = columns.find(star.id); column != columns.end()) row.px[column->second] = star.px;
      log.rows.push_back(std::move(row));
    }
    return rotation_log_csv(config_.before ? joined_logs(*config_.before, log) : log);
  }
  void estimate() {
    result_.log_csv = log_text();
    result_.report = observed(result_);
  }
  void tell_so_far() {
    constexpr double pause_s = 3.0;
    if (!config_.on_so_far || shots_.empty() || head_.now_s() - given_s_ < pause_s) return;
    given_s_ = head_.now_s();
    result_.log_csv = log_text();
    result_.head_time_s = head_time();
    config_.on_so_far(result_);
  }

  MovingHead& head_;
  FrameStream& stream_;
  const HeadCalibrationConfig& config_;
  const Progress& progress_;
  HeadCalibration& result_;
  HeadPosition reading_;
  StarTracks tracks_;
  std::vector<Shot> shots_;
  bool is_found_ = false;
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d px_by_rad_ = Eigen::Matrix2d::Identity();
  double begin_s_ = 0.0, still_since_s_ = 0.0, given_s_ = 0.0;
};

}  // namespace

void calibrate_by_shots(MovingHead& head, FrameStream& stream, const HeadCalibrationConfig& config,
                        const Progress& progress, HeadCalibration& result) {
  ShotSession(head, stream, config, progress, result).run();
}

}  // namespace alidade
