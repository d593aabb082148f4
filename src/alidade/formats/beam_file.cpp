#include "alidade/formats/beam_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/files/yaml_fields.h"

namespace alidade {
namespace {

using detail::Fields;
using detail::number_list;
using detail::number_text;
using detail::refuse;

using Embedding = Eigen::Matrix<double, 7, num_beam_params>;

Embedding embedding_of(const Eigen::Vector3d& direction) {
  Embedding J = Embedding::Zero();
  J.topLeftCorner<3, 3>().setIdentity();
  J.block<3, 2>(3, beam_direction_param) = tangent_basis(direction);
  J(6, beam_scale_param) = 1.0;
  return J;
}

template <class Matrix>
std::vector<double> row_major(const Matrix& matrix) {
  std::vector<double> numbers;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) numbers.push_back(matrix(i, j));
  return numbers;
}

std::vector<double> upper_of(const Eigen::Matrix<double, 7, 7>& cov) {
  std::vector<double> numbers;
  for (Eigen::Index i = 0; i < 7; ++i)
    for (Eigen::Index j = i; j < 7; ++j) numbers.push_back(cov(i, j));
  return numbers;
}

/// Of origin, direction (as a vector, singular along itself: no basis has to be stored with it) and scale, taken to the
/// tangent of the direction: the embedding's columns are orthonormal.
BeamMatrix read_beam_covariance(const YAML::Node& node, const Fields& fields, const Eigen::Vector3d& direction) {
  const Embedding J = embedding_of(direction);
  return J.transpose() *
         detail::read_covariance(node, fields, {embedded_beam_names.begin(), embedded_beam_names.end()}, "a beam") * J;
}

Eigen::MatrixXd read_cov_with_lens(const Fields& fields, const Eigen::Vector3d& direction) {
  const std::vector<double> numbers = fields.numbers("covariance_with_camera");
  if (numbers.empty() || numbers.size() % 7 != 0)
    refuse(fields.file(), fields.full("covariance_with_camera"), "must be 7 rows of numbers, one per lens parameter");
  const auto cols = static_cast<Eigen::Index>(numbers.size() / 7);
  const Eigen::Map<const Eigen::Matrix<double, 7, Eigen::Dynamic, Eigen::RowMajor>> embedded(numbers.data(), 7, cols);
  return embedding_of(direction).transpose() * embedded;
}

const std::vector<std::string> keys{"origin_m",
                                    "direction",
                                    "theta_x_rad",
                                    "theta_y_rad",
                                    "scale",
                                    "sigma_range_m",
                                    "sigma_range_per_m",
                                    "sigma_range_incidence_m",
                                    "covariance",
                                    "covariance_with_camera",
                                    "camera",
                                    detail::verdict_keys[0],
                                    detail::verdict_keys[1]};

double not_negative(const Fields& fields, const std::string& key, double otherwise) {
  if (!fields.has(key)) return otherwise;
  const double value = fields.number(key);
  if (value < 0.0) refuse(fields.file(), key, "is below zero");
  return value;
}

}  // namespace

std::string beam_text(const Beam& beam, const Camera& camera, const std::string& camera_file) {
  const Eigen::Vector3d& o = beam.origin_in_cam;
  const Eigen::Vector3d& a = beam.direction_in_cam;
  const Eigen::Vector2d theta = direction_angles_rad(beam);
  std::string text = "# point in camera = origin_m + scale * range_m * direction\n";
  text += fmt::format("origin_m: {}\n", number_list({o.x(), o.y(), o.z()}));
  text += fmt::format("direction: {}\n", number_list({a.x(), a.y(), a.z()}));
  text += fmt::format("theta_x_rad: {}\ntheta_y_rad: {}\n", number_text(theta.x()), number_text(theta.y()));
  text += fmt::format("scale: {}\nsigma_range_m: {}\n", number_text(beam.scale), number_text(beam.noise.sigma_m));
  if (beam.noise.per_m > 0.0) text += fmt::format("sigma_range_per_m: {}\n", number_text(beam.noise.per_m));
  if (beam.noise.incidence_m > 0.0)
    text += fmt::format("sigma_range_incidence_m: {}\n", number_text(beam.noise.incidence_m));
  if (!camera_file.empty()) text += fmt::format("camera: {}\n", camera_file);
  if (beam.cov.isZero(0.0)) return text;
  text += fmt::format("covariance:  # upper triangle, row by row\n  names: [{}]\n  upper: {}\n",
                      fmt::join(embedded_beam_names, ", "), number_list(upper_of(embedded_covariance(beam))));
  if (beam.cov_with_lens.size() > 0) {
    const Eigen::MatrixXd embedded = embedding_of(a) * beam.cov_with_lens;
    text += fmt::format("covariance_with_camera: {}  # 7 rows, a column for each of {}\n",
                        number_list(row_major(embedded)), fmt::join(param_names(camera.lens), ", "));
  }
  return text;
}

BeamFile read_beam(const std::filesystem::path& file) {
  const YAML::Node root = detail::load_yaml(read_file(file), file.string());
  const Fields fields(root, file.string());
  detail::refuse_unknown_keys(fields, keys, "a beam");
  BeamFile read;
  Beam& beam = read.beam;
  beam.origin_in_cam = detail::read_vector(fields, "origin_m");
  beam.direction_in_cam = detail::read_vector(fields, "direction");
  const double length = beam.direction_in_cam.norm();
  if (!(std::abs(length - 1.0) < 1e-3))
    refuse(file.string(), "direction", fmt::format("has the length {:.6g}, not 1", length));
  beam.direction_in_cam /= length;
  if (fields.has("scale")) beam.scale = fields.number("scale");
  if (!(beam.scale > 0.0)) refuse(file.string(), "scale", "is not above zero");
  beam.noise.sigma_m = not_negative(fields, "sigma_range_m", 0.0);
  beam.noise.per_m = not_negative(fields, "sigma_range_per_m", 0.0);
  beam.noise.incidence_m = not_negative(fields, "sigma_range_incidence_m", 0.0);
  if (fields.has("covariance")) beam.cov = read_beam_covariance(root["covariance"], fields, beam.direction_in_cam);
  if (fields.has("covariance_with_camera")) beam.cov_with_lens = read_cov_with_lens(fields, beam.direction_in_cam);
  if (fields.has("camera")) read.camera = file.parent_path() / fields.text("camera");
  return read;
}

}  // namespace alidade
