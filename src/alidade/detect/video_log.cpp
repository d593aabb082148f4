#include "alidade/detect/video_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <sstream>

#include "alidade/estimation/median.h"
#include "alidade/files/files.h"
#include "alidade/tables/logs/angle_interpolation.h"
#include "alidade/tables/logs/rotation_log_stream.h"

namespace alidade {
namespace {

/// Where each point was seen, frame by frame.
struct Tracks {
  std::vector<std::size_t> numbers;  ///< Of the frames, from 0.
  std::vector<std::vector<TrackedPoint>> frames;
  int width_px = 0, height_px = 0;
};

Tracks follow_points(VideoFrames& video, const PointTrackerConfig& config, const Progress& progress) {
  Tracks tracks;
  PointTracker tracker(config);
  for (cv::Mat frame = video.next(); !frame.empty(); frame = video.next()) {
    tracks.width_px = frame.cols;
    tracks.height_px = frame.rows;
    tracks.numbers.push_back(video.number());
    tracks.frames.push_back(tracker.update(frame));
    report_progress(progress, "following points", tracks.frames.size(),
                    std::max(tracks.frames.size(), video.num_frames()));
  }
  if (tracks.frames.size() < 2)
    throw InputError(video.name() + ": has only one frame; a video of a rotation is needed");
  return tracks;
}

/// Column of each point that is kept, by id.
std::map<int, std::size_t> columns_of(const Tracks& tracks, const VideoLogConfig& config, std::size_t& num_tracks) {
  std::map<int, std::size_t> seen;
  for (const auto& frame : tracks.frames)
    for (const TrackedPoint& point : frame) ++seen[point.id];
  num_tracks = seen.size();
  std::erase_if(seen, [&](const auto& each) { return each.second < config.min_rows; });
  std::vector<std::pair<int, std::size_t>> longest(seen.begin(), seen.end());
  std::ranges::stable_sort(longest, [](const auto& a, const auto& b) { return a.second > b.second; });
  longest.resize(std::min(longest.size(), config.max_points));
  std::map<int, std::size_t> columns;
  for (const auto& [id, count] : longest) columns[id] = 0;
  std::size_t next = 0;
  for (auto& [id, column] : columns) column = next++;
  return columns;
}

/// The rows of the log, without pixels, and which of them are frames.
struct Rows {
  RotationLog log;
  std::vector<std::size_t> of_frame;
};

Rows rows_one_a_frame(const RotationLog& angles, const std::string& angles_name, const Tracks& tracks) {
  const std::size_t needed = tracks.numbers.back() + 1;
  if (angles.rows.size() != needed)
    throw InputError(
        fmt::format("{}: has {} rows and the video {} frames; one row per frame is needed, or '--rate' to "
                    "interpolate by time",
                    angles_name, angles.rows.size(), needed));
  Rows rows;
  for (const std::size_t number : tracks.numbers) {
    rows.of_frame.push_back(rows.log.rows.size());
    rows.log.rows.push_back(angles.rows[number]);
    rows.log.rows.back().px.clear();
    if (!angles.truth.empty()) rows.log.truth.push_back(angles.truth[number]);
  }
  return rows;
}

Rows rows_by_time(const RotationLog& angles, const std::string& angles_name, const Tracks& tracks, double rate_hz) {
  const AngleInterpolation interpolation(angles);
  Rows rows;
  const auto add = [&](RotationRow row) {
    if (!angles.truth.empty()) rows.log.truth.push_back(interpolation.truth_at(row.t_s));
    rows.log.rows.push_back(std::move(row));
  };
  for (const std::size_t number : tracks.numbers) {
    const double t_s = static_cast<double>(number) / rate_hz;
    if (!interpolation.covers(t_s))
      throw InputError(fmt::format("{}: covers t = {:.6g} … {:.6g} s, but frame {} is at {:.6g} s by '--rate {:g}'",
                                   angles_name, interpolation.first_s(), interpolation.last_s(), number, t_s, rate_hz));
    if (angles.source == RotationSource::rate && !rows.log.rows.empty())
      for (RotationRow& sample : interpolation.between(rows.log.rows.back().t_s, t_s)) add(std::move(sample));
    rows.of_frame.push_back(rows.log.rows.size());
    add(interpolation.at(t_s));
  }
  return rows;
}

}  // namespace

RotationLog read_angles(const std::filesystem::path& csv) {
  std::istringstream text(read_file(csv));
  RotationLogStream stream(text, csv.string(), {.needs_points = false});
  RotationLog angles = stream.layout();
  angles.num_points = 0;
  while (std::optional<RotationLogEntry> entry = stream.next()) {
    entry->row.px.clear();
    angles.rows.push_back(std::move(entry->row));
    if (entry->truth) angles.truth.push_back(*entry->truth);
  }
  angles.sigma_scale = stream.layout().sigma_scale;
  angles.sigma_parallax = stream.layout().sigma_parallax;
  if (angles.rows.empty()) throw InputError(csv.string() + ": has no rows");
  return angles;
}

VideoLog log_from_video(VideoFrames& video, const RotationLog& angles, const std::string& angles_name,
                        const VideoLogConfig& config, const Progress& progress) {
  const Tracks tracks = follow_points(video, config.tracker, progress);
  Rows rows = config.rate_hz > 0.0 ? rows_by_time(angles, angles_name, tracks, config.rate_hz)
                                   : rows_one_a_frame(angles, angles_name, tracks);
  VideoLog made{.log = std::move(rows.log), .width_px = tracks.width_px, .height_px = tracks.height_px};
  made.num_frames = tracks.frames.size();
  const std::map<int, std::size_t> columns = columns_of(tracks, config, made.num_tracks);
  if (columns.empty())
    throw InputError(
        fmt::format("{}: no point could be followed through {} frames; the camera must see corners or "
                    "texture, sharply",
                    video.name(), config.min_rows));
  made.log.source = angles.source;
  made.log.sigma_scale = angles.sigma_scale;
  made.log.sigma_parallax = angles.sigma_parallax;
  made.log.num_points = columns.size();
  made.log.has_roll_rate = angles.has_roll_rate;
  made.log.has_velocity = angles.has_velocity;
  for (RotationRow& row : made.log.rows) row.px.assign(columns.size(), Eigen::Vector2d::Constant(not_seen));
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < tracks.frames.size(); ++i) {
    for (const TrackedPoint& point : tracks.frames[i]) {
      const auto column = columns.find(point.id);
      if (column == columns.end()) continue;
      made.log.rows[rows.of_frame[i]].px[column->second] = point.px;
      sigmas.push_back(point.sigma_px);
    }
  }
  made.median_sigma_px = median_of(std::move(sigmas));
  return made;
}

}  // namespace alidade
