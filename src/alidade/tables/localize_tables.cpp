#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>

#include "alidade/files/table_rows.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/logs/observations_stream.h"

namespace alidade {
namespace {

/// In a TUM file the quaternion's real part is last, elsewhere first.
std::string pose_cells(const Rigid3& world_from_cam, bool is_tum) {
  const Eigen::Vector3d& t = world_from_cam.translation;
  const Eigen::Quaterniond& q = world_from_cam.rotation;
  const char between = is_tum ? ' ' : ',';
  std::array<double, 7> cells{t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()};
  if (is_tum) std::rotate(cells.begin() + 3, cells.begin() + 4, cells.end());
  std::string text;
  for (const double cell : cells) text += between + fmt::format("{:.9f}", cell);
  return text;
}

double sigma_of(const MapPoint& point) { return std::sqrt(point.cov.trace() / 3.0); }

}  // namespace

ObservationTable read_observations(const std::filesystem::path& file, const ObservationsOptions& options) {
  std::istringstream text(read_file(file));  // row by row: all cells together are four times as long
  ObservationsStream rows(text, file.string(), options);
  ObservationTable read;
  while (auto frame = rows.next()) read.frames.push_back(std::move(*frame));
  read.skipped = rows.skipped();
  return read;
}

namespace {

/// The time of a row, after that of the row before it.
double later_time(const Csv& csv, std::size_t row, std::optional<double> last_t_s) {
  const double t_s = csv.number(row, "t_s");
  if (last_t_s && !(t_s > *last_t_s))
    throw InputError(csv.where(row, "t_s") +
                     fmt::format(": '{}' is not after the row before it", csv.text(row, "t_s")));
  return t_s;
}

void add_named(std::vector<SkippedInput> named, std::vector<SkippedInput>* skipped) {
  if (skipped != nullptr) std::ranges::move(named, std::back_inserter(*skipped));
}

}  // namespace

std::vector<DepthReading> read_depth_sensor(const std::filesystem::path& file, bool skip_bad,
                                            std::vector<SkippedInput>* skipped) {
  const Csv csv = Csv::read(file, skip_bad);
  csv.require(std::array<std::string, 2>{"t_s", "depth_m"});
  std::vector<DepthReading> readings;
  std::vector<SkippedInput> named;
  for_each_row(csv, skip_bad, named, [&](std::size_t row) {
    DepthReading reading;
    reading.t_s = later_time(csv, row, readings.empty() ? std::nullopt : std::optional(readings.back().t_s));
    reading.depth_m = csv.number(row, "depth_m");
    if (csv.has("sigma_m")) reading.sigma_m = csv.positive(row, "sigma_m");
    readings.push_back(reading);
  });
  add_named(std::move(named), skipped);
  if (readings.empty()) throw InputError(file.string() + ": has no readings; at least one row is needed");
  return readings;
}

std::vector<RangeReading> read_ranges(const std::filesystem::path& file, bool skip_bad,
                                      std::vector<SkippedInput>* skipped) {
  const Csv csv = Csv::read(file, skip_bad);
  csv.require(std::array<std::string, 2>{"t_s", "range_m"});
  std::vector<RangeReading> readings;
  std::vector<SkippedInput> named;
  for_each_row(csv, skip_bad, named, [&](std::size_t row) {
    readings.push_back({later_time(csv, row, readings.empty() ? std::nullopt : std::optional(readings.back().t_s)),
                        csv.positive(row, "range_m")});
  });
  add_named(std::move(named), skipped);
  if (readings.empty()) throw InputError(file.string() + ": has no readings; at least one row is needed");
  return readings;
}

std::vector<OdometryReading> read_odometry(const std::filesystem::path& file, bool skip_bad,
                                           std::vector<SkippedInput>* skipped) {
  const Csv csv = Csv::read(file, skip_bad);
  csv.require(std::array<std::string, 3>{"t_s", "x_m", "y_m"});
  std::vector<OdometryReading> readings;
  std::vector<SkippedInput> named;
  for_each_row(csv, skip_bad, named, [&](std::size_t row) {
    OdometryReading reading;
    reading.t_s = later_time(csv, row, readings.empty() ? std::nullopt : std::optional(readings.back().t_s));
    reading.position_m = {csv.number(row, "x_m"), csv.number(row, "y_m"), 0.0};
    if (csv.has("z_m")) reading.position_m.z() = csv.number(row, "z_m");
    readings.push_back(reading);
  });
  add_named(std::move(named), skipped);
  if (readings.empty()) throw InputError(file.string() + ": has no readings; at least one row is needed");
  return readings;
}

std::string observations_csv(std::span<const ObservationFrame> frames) {
  std::string text = "frame,t_s,point_id,u_px,v_px\n";
  for (const ObservationFrame& frame : frames) {
    if (frame.observations.empty()) text += fmt::format("{},{:.9f},,,\n", frame.frame, frame.t_s);
    for (const FeatureObservation& observation : frame.observations)
      text += fmt::format("{},{:.9f},{},{:.4f},{:.4f}\n", frame.frame, frame.t_s, observation.id, observation.px.x(),
                          observation.px.y());
  }
  return text;
}

std::vector<TimedPose> read_tum(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  std::vector<TimedPose> poses;
  std::size_t line = 0, at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string row = text.substr(at, end - at);
    at = end + 1;
    ++line;
    const std::size_t first = row.find_first_not_of(" \t\r");
    if (first == std::string::npos || row[first] == '#') continue;
    const auto fail = [&](const std::string& what) {
      throw InputError(fmt::format("{}:{}: {}", file.string(), line, what));
    };
    std::vector<double> cells;
    for (std::size_t from = first; from != std::string::npos && from < row.size();) {
      const std::size_t to = std::min(row.find_first_of(" \t\r", from), row.size());
      cells.push_back(csv_number(row.substr(from, to - from), {file.string(), line, "pose"}));
      from = row.find_first_not_of(" \t\r", to);
    }
    if (cells.size() != 8) fail("is not 't x y z qx qy qz qw'");
    const Eigen::Quaterniond rotation(cells[7], cells[4], cells[5], cells[6]);
    if (!(std::abs(rotation.norm() - 1.0) < 1e-2)) fail("the quaternion has not the length 1");
    if (!poses.empty() && !(cells[0] > poses.back().t_s)) fail("its time is not after the one before it");
    poses.push_back({cells[0], {rotation.normalized(), {cells[1], cells[2], cells[3]}}});
  }
  if (poses.empty()) throw InputError(file.string() + ": has no poses");
  return poses;
}

std::string tum_text(std::span<const TimedPose> poses) {
  std::string text = "# t x y z qx qy qz qw: world_from_cam\n";
  for (const TimedPose& pose : poses)
    text += fmt::format("{:.9f}", pose.t_s) + pose_cells(pose.world_from_cam, true) + "\n";
  return text;
}

std::string map_csv(std::span<const MapPoint> points) {
  std::string text =
      "point_id,x_m,y_m,z_m,sigma_m,cov_xx_m2,cov_xy_m2,cov_xz_m2,cov_yy_m2,cov_yz_m2,cov_zz_m2,known,num_seen\n";
  for (const MapPoint& point : points) {
    const Eigen::Vector3d& p = point.point_in_world;
    text += fmt::format("{},{:.7f},{:.7f},{:.7f},{:.6g}", point.id, p.x(), p.y(), p.z(), sigma_of(point));
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) text += fmt::format(",{:.6g}", point.cov(i, j));
    text += fmt::format(",{},{}\n", point.is_known ? 1 : 0, point.num_seen);
  }
  return text;
}

std::string map_ply(std::span<const MapPoint> points) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "property double sigma_m\nproperty int point_id\nend_header\n",
      points.size());
  for (const MapPoint& point : points) {
    const Eigen::Vector3d& p = point.point_in_world;
    text += fmt::format("{:.7f} {:.7f} {:.7f} {:.6g} {}\n", p.x(), p.y(), p.z(), sigma_of(point), point.id);
  }
  return text;
}

std::string poses_csv(std::span<const PathStep> path) {
  constexpr std::array<const char*, 6> names{"x", "y", "z", "rx", "ry", "rz"};
  std::string text = "frame,t_s,x_m,y_m,z_m,qw,qx,qy,qz";
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i; j < 6; ++j) text += fmt::format(",cov_{}_{}", names[i], names[j]);
  text += ",num_seen,num_tracked,num_gated,nis_per_dof,event\n";
  for (const PathStep& step : path) {
    text += fmt::format("{},{:.9f}", step.frame, step.t_s);
    text += step.has_pose() ? pose_cells(step.world_from_cam, false) : ",,,,,,,";
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) text += step.has_pose() ? fmt::format(",{:.6g}", step.cov(i, j)) : ",";
    const std::string nis = std::isfinite(step.nis_per_dof) ? fmt::format("{:.4f}", step.nis_per_dof) : "";
    text +=
        fmt::format(",{},{},{},{},{}\n", step.num_seen, step.num_tracked, step.num_gated, nis, event_name(step.event));
  }
  return text;
}

}  // namespace alidade
