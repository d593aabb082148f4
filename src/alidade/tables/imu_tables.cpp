#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "alidade/files/table_rows.h"
#include "alidade/files/yaml_fields.h"
#include "alidade/tables/localize_file.h"

namespace alidade {
namespace {

using ImuColumns = std::array<std::string, 7>;  // time, rates, forces

const ImuColumns imu_columns{"t_s",          "omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s",
                             "force_x_m_s2", "force_y_m_s2",  "force_z_m_s2"};
/// Those of EuRoC's imu0/data.csv, times as whole nanoseconds.
const ImuColumns euroc_columns{"timestamp_ns",      "w_RS_S_x [rad s^-1]", "w_RS_S_y [rad s^-1]", "w_RS_S_z [rad s^-1]",
                               "a_RS_S_x [m s^-2]", "a_RS_S_y [m s^-2]",   "a_RS_S_z [m s^-2]"};

/// Nanoseconds since 1970 need more digits than a double has: the difference is taken before.
double seconds_after(const Csv& csv, std::size_t row, std::int64_t origin_ns) {
  return 1e-9 *
         static_cast<double>(csv.integer(row, euroc_columns[0], 0, std::numeric_limits<long>::max()) - origin_ns);
}

double positive_or(const detail::Fields& fields, const std::string& key, double otherwise) {
  if (!fields.has(key)) return otherwise;
  const double value = fields.number(key);
  if (!(value > 0.0)) detail::refuse(fields.file(), fields.full(key), "is not above zero");
  return value;
}

/// Kalibr's, four rows of four.
Rigid3 matrix_pose(const YAML::Node& node, const std::string& file) {
  constexpr double straight = 1e-3;
  const std::string key = "T_cam_imu";
  if (!node.IsSequence() || (node.size() != 4 && node.size() != 3)) detail::refuse(file, key, "is not four rows");
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  for (std::size_t i = 0; i < node.size(); ++i) {
    if (!node[i].IsSequence() || node[i].size() != 4) detail::refuse(file, key, "has a row that is not four numbers");
    for (std::size_t j = 0; j < 4; ++j)
      T(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          detail::checked_number(node[i][j].IsScalar() ? node[i][j].Scalar() : "", file, key);
  }
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < straight) || !(R.determinant() > 0.0))
    detail::refuse(file, key, "has a rotation that is none");
  return {Eigen::Quaterniond(R).normalized(), T.topRightCorner<3, 1>()};
}

Eigen::Quaterniond imu_rotation(const detail::Fields& fields) {
  const std::vector<double> q = fields.numbers("quaternion_wxyz");
  constexpr double of_unit = 1e-3;
  if (q.size() != 4) detail::refuse(fields.file(), "quaternion_wxyz", "must be 4 numbers");
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (!(std::abs(rotation.norm() - 1.0) < of_unit))
    detail::refuse(fields.file(), "quaternion_wxyz", fmt::format("has the length {:.6g}, not 1", rotation.norm()));
  return rotation.normalized();
}

}  // namespace

std::vector<ImuReading> read_imu(const std::filesystem::path& file, bool skip_bad, std::vector<SkippedInput>* skipped,
                                 std::int64_t origin_ns) {
  const Csv csv = Csv::read(file, skip_bad);
  const bool is_euroc = csv.has(euroc_columns[1]);
  const ImuColumns& columns = is_euroc ? euroc_columns : imu_columns;
  csv.require(columns);
  std::vector<ImuReading> readings;
  std::vector<SkippedInput> named;
  for_each_row(csv, skip_bad, named, [&](std::size_t row) {
    ImuReading reading;
    reading.t_s = is_euroc ? seconds_after(csv, row, origin_ns) : csv.number(row, columns[0]);
    if (!readings.empty() && !(reading.t_s > readings.back().t_s))
      throw InputError(csv.where(row, columns[0]) +
                       fmt::format(": '{}' is not after the row before it", csv.text(row, columns[0])));
    for (std::size_t i = 0; i < 3; ++i) {
      reading.rate_rad_s[static_cast<Eigen::Index>(i)] = csv.number(row, columns[1 + i]);
      reading.force_m_s2[static_cast<Eigen::Index>(i)] = csv.number(row, columns[4 + i]);
    }
    readings.push_back(reading);
  });
  if (skipped != nullptr) std::ranges::move(named, std::back_inserter(*skipped));
  constexpr std::size_t enough = 3;
  if (readings.size() < enough) throw InputError(file.string() + ": has fewer than three readings");
  return readings;
}

std::string imu_csv(std::span<const ImuReading> readings) {
  std::string text;
  for (const std::string& column : imu_columns) text += (text.empty() ? "" : ",") + column;
  text += '\n';
  for (const ImuReading& reading : readings) {
    const Eigen::Vector3d &w = reading.rate_rad_s, &f = reading.force_m_s2;
    text += fmt::format("{:.9f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", reading.t_s, w.x(), w.y(), w.z(), f.x(),
                        f.y(), f.z());
  }
  return text;
}

ImuMounting read_imu_mounting(const std::filesystem::path& file) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const detail::Fields fields(root, name);
  detail::refuse_unknown_keys(
      fields, {"translation_m", "quaternion_wxyz", "T_cam_imu", "sigma_rotation_rad", "sigma_translation_m"},
      "a mounting of an IMU");
  ImuMounting mounting;
  if (fields.has("T_cam_imu") == fields.has("quaternion_wxyz"))
    detail::refuse(name, "quaternion_wxyz", "or 'T_cam_imu': one of them is needed");
  if (fields.has("T_cam_imu") && fields.has("translation_m"))
    detail::refuse(name, "translation_m", "stands in 'T_cam_imu' as well: give one of them");
  if (fields.has("T_cam_imu")) {
    mounting.cam_from_imu = matrix_pose(root["T_cam_imu"], name);
  } else {
    mounting.cam_from_imu.rotation = imu_rotation(fields);
    if (fields.has("translation_m")) mounting.cam_from_imu.translation = detail::read_vector(fields, "translation_m");
  }
  mounting.sigma_rotation_rad = positive_or(fields, "sigma_rotation_rad", mounting.sigma_rotation_rad);
  mounting.sigma_position_m = positive_or(fields, "sigma_translation_m", mounting.sigma_position_m);
  return mounting;
}

std::string imu_mounting_text(const ImuMounting& mounting) {
  const Eigen::Quaterniond& q = mounting.cam_from_imu.rotation;
  const Eigen::Vector3d& t = mounting.cam_from_imu.translation;
  return fmt::format(
      "# cam_from_imu: from the axes of the IMU to the camera's (x right, y down, z forward)\n"
      "translation_m: {}\nquaternion_wxyz: {}\nsigma_rotation_rad: {}\nsigma_translation_m: {}\n",
      detail::number_list({t.x(), t.y(), t.z()}), detail::number_list({q.w(), q.x(), q.y(), q.z()}),
      detail::number_text(mounting.sigma_rotation_rad), detail::number_text(mounting.sigma_position_m));
}

}  // namespace alidade
