#include "alidade/detect/video_observations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/pantilt/head_view.h"
#include "alidade/tables/logs/angle_interpolation.h"
#include "alidade/tables/logs/head_column.h"

namespace alidade {
namespace {

std::string time_column(const Csv& csv) {
  for (const char* name : {"t_s", "t_capture_s"})
    if (csv.has(name)) return name;
  throw InputError(csv.name() + ": has no column 't_s'");
}

std::string angle_column(const Csv& csv, const std::string& axis) {
  for (const std::string& name : {axis + "_rad", axis + "_rad_at_capture"})
    if (csv.has(name)) return name;
  throw InputError(csv.name() + ": has no column '" + axis + "_rad'");
}

void check_complete(const HeadAngles& angles, std::span<const RigHead> heads) {
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (angles.logs[i].rows.empty())
      throw InputError(fmt::format("{}: has no rows of head {}", angles.name, heads[i].head.id));
  }
}

/// One head's way from frames to angles.
class Clock {
 public:
  Clock(const RotationLog& log, const HeadAngles& angles, int id, double rate_hz)
      : log_(log), name_(angles.name), id_(id), rate_hz_(rate_hz), between_(log) {}

  [[nodiscard]] RotationRow at(std::size_t number) const {
    if (!(rate_hz_ > 0.0)) {
      if (number >= log_.rows.size())
        throw InputError(
            fmt::format("{}: has {} rows of head {} and the video more frames; one row a frame is needed, or '--rate' "
                        "to interpolate by time",
                        name_, log_.rows.size(), id_));
      return log_.rows[number];
    }
    const double t_s = static_cast<double>(number) / rate_hz_;
    if (!between_.covers(t_s))
      throw InputError(
          fmt::format("{}: covers t = {:.6g} … {:.6g} s of head {}, but frame {} is at {:.6g} s by '--rate "
                      "{:g}'",
                      name_, between_.first_s(), between_.last_s(), id_, number, t_s, rate_hz_));
    return between_.at(t_s);
  }
  /// Where no rate is given, one row per frame: all of them.
  void check_end(std::size_t num_frames) const {
    if (rate_hz_ > 0.0 || num_frames == log_.rows.size()) return;
    throw InputError(
        fmt::format("{}: has {} rows of head {} and the video {} frames; one row a frame is needed, or "
                    "'--rate' to interpolate by time",
                    name_, log_.rows.size(), id_, num_frames));
  }

 private:
  const RotationLog& log_;
  const std::string& name_;
  int id_;
  double rate_hz_;
  AngleInterpolation between_;
};

/// Follows the target through one video.
class Follower {
 public:
  Follower(const RigHead& head, const TargetLook& look, const cv::Mat* pattern, double max_speed_px_s)
      : head_(head), detector_(look, pattern), max_speed_px_s_(max_speed_px_s) {}

  TargetDetection find(const cv::Mat& frame, double t_s, const Eigen::Vector2d& pan_tilt_rad) {
    const std::optional<TargetExpectation> expected = expectation(t_s, pan_tilt_rad);
    TargetDetection seen = detector_.find(frame, expected);
    if (!seen.found() && expected) seen = detector_.find(frame);
    if (!seen.found()) return seen;
    if (const auto ray = ray_in_world(head_, pan_tilt_rad, seen.px)) {
      last_direction_in_world_ = ray->direction_in_world;
      last_s_ = t_s;
    }
    return seen;
  }

 private:
  /// A distant target that was static since it was last seen; its speed widens the search.
  std::optional<TargetExpectation> expectation(double t_s, const Eigen::Vector2d& pan_tilt_rad) const {
    if (!last_direction_in_world_) return std::nullopt;
    const TurnedHead turned(head_.head, pan_tilt_rad);
    const auto px = project(head_.camera, turned.cam_from_world_rotation * *last_direction_in_world_);
    if (!px) return std::nullopt;
    const double reach_px = 5.0 + max_speed_px_s_ * std::max(0.0, t_s - last_s_);
    return TargetExpectation{*px, 0.25 * reach_px};
  }

  const RigHead& head_;
  TargetDetector detector_;
  double max_speed_px_s_;
  std::optional<Eigen::Vector3d> last_direction_in_world_;
  double last_s_ = 0.0;
};

}  // namespace

HeadAngles read_head_angles(const std::filesystem::path& file, std::span<const RigHead> heads) {
  const Csv csv = Csv::read(file);
  if (!csv.has("head") && heads.size() > 1)
    throw InputError(csv.name() + fmt::format(": has no column 'head', and the rig has {} heads", heads.size()));
  const std::string t = time_column(csv), pan = angle_column(csv, "pan"), tilt = angle_column(csv, "tilt");
  HeadAngles angles{csv.name(), std::vector<RotationLog>(heads.size())};
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    RotationLog& log = angles.logs[csv.has("head") ? head_in_row(csv, row, heads) : 0];
    log.source = RotationSource::head;
    RotationRow now;
    now.t_s = csv.number(row, t);
    if (!log.rows.empty() && !(now.t_s > log.rows.back().t_s))
      throw InputError(csv.where(row, t) + ": '" + csv.text(row, t) + "' is not after the row before it of that head");
    const Encoder& zero = heads[static_cast<std::size_t>(&log - angles.logs.data())].head.encoder;
    const Eigen::Vector3d last_rad = log.rows.empty() ? Eigen::Vector3d(zero.pan_zero_rad, zero.tilt_zero_rad, 0.0)
                                                      : log.rows.back().pan_tilt_roll_rad;
    now.pan_tilt_roll_rad = {reading_after(angle_in_row(csv, row, pan), last_rad.x()),
                             reading_after(angle_in_row(csv, row, tilt), last_rad.y()), 0.0};
    log.rows.push_back(now);
  }
  check_complete(angles, heads);
  return angles;
}

std::string head_angles_csv(const HeadAngles& angles, std::span<const RigHead> heads) {
  std::string text = "t_s,head,pan_rad,tilt_rad\n";
  for (std::size_t i = 0; i < heads.size(); ++i) {
    for (const RotationRow& row : angles.logs[i].rows)
      text += fmt::format("{:.6f},{},{:.9f},{:.9f}\n", row.t_s, heads[i].head.id, row.pan_tilt_roll_rad.x(),
                          row.pan_tilt_roll_rad.y());
  }
  return text;
}

std::vector<TargetFrame> target_frames(std::span<VideoFrames> videos, const HeadAngles& angles,
                                       std::span<const RigHead> heads, const TargetLook& look, const cv::Mat* pattern,
                                       const VideoObservationsConfig& config, const Progress& progress) {
  if (videos.size() != heads.size())
    throw InputError(fmt::format("the rig has {} heads, but {} videos are given", heads.size(), videos.size()));
  std::vector<TargetFrame> frames;
  std::size_t num_all = 0;
  for (const VideoFrames& video : videos) num_all += video.num_frames();
  for (std::size_t i = 0; i < videos.size(); ++i) {
    const Clock clock(angles.logs[i], angles, heads[i].head.id, config.rate_hz);
    Follower follower(heads[i], look, pattern, config.max_speed_px_s);
    const Camera& camera = heads[i].camera;
    std::size_t num_frames = 0;
    for (cv::Mat frame = videos[i].next(); !frame.empty(); frame = videos[i].next()) {
      if (frame.cols != camera.width_px || frame.rows != camera.height_px)
        throw InputError(fmt::format("{}: frames are {}x{}, but the camera of head {} has {}x{}", videos[i].name(),
                                     frame.cols, frame.rows, heads[i].head.id, camera.width_px, camera.height_px));
      TargetFrame now;
      now.head = i;
      now.number = videos[i].number();
      const RotationRow row = clock.at(now.number);
      now.t_s = row.t_s;
      now.pan_tilt_rad = row.pan_tilt_roll_rad.head<2>();
      now.seen = follower.find(frame, now.t_s, now.pan_tilt_rad);
      num_frames = now.number + 1;
      frames.push_back(std::move(now));
      report_progress(progress, "looking for the target", frames.size(), std::max(frames.size(), num_all));
    }
    clock.check_end(num_frames);
  }
  std::ranges::stable_sort(frames, [](const TargetFrame& a, const TargetFrame& b) { return a.t_s < b.t_s; });
  return frames;
}

std::vector<TargetObservation> observations_of(std::span<const TargetFrame> frames) {
  std::vector<TargetObservation> observations;
  for (const TargetFrame& frame : frames) {
    if (!frame.seen.found()) continue;
    const double sigma_px = std::sqrt(0.5 * frame.seen.cov.trace());
    observations.push_back({frame.t_s, frame.t_s, frame.head, frame.pan_tilt_rad, frame.seen.px, sigma_px});
  }
  return observations;
}

}  // namespace alidade
