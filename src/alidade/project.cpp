#include "alidade/project.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/camera/camera_fault.h"
#include "alidade/geometry/covariance.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/checks/track_assumed.h"

namespace alidade {
namespace {

constexpr double max_length_m = 1e6;

/// By how much of its own σ a pixel or a point moves at most, and which.
void put_move(const ProjectedReading& one, const Eigen::Vector3d& moved_m, const Eigen::Vector2d& moved_px,
              Assumption& assumption) {
  const auto heed_one = [&](const std::string& name, double moved, double variance) {
    constexpr double most = 1e6;  // where no σ is stated at all
    const double in_sigmas = moved == 0.0 ? 0.0 : std::min(most, std::abs(moved) / std::sqrt(std::max(variance, 0.0)));
    if (!(in_sigmas > assumption.moves)) return;
    assumption.moves = in_sigmas;
    assumption.moved = name;
    assumption.moved_by = moved;
  };
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    heed_one(fmt::format("point_in_cam_m {} at {:g} m", axes[static_cast<std::size_t>(i)], one.range_m), moved_m[i],
             one.point.cov(i, i));
  if (!one.pixel) return;
  heed_one(fmt::format("u_px at {:g} m", one.range_m), moved_px.x(), one.pixel->cov(0, 0));
  heed_one(fmt::format("v_px at {:g} m", one.range_m), moved_px.y(), one.pixel->cov(1, 1));
}

/// One assumption, and the effect of its σ, or of a typical error, on every point and pixel.
template <class Moves>
Assumption assumption_of(const std::string& name, double value, std::optional<double> sigma, double ordinary,
                         const std::vector<ProjectedReading>& projected, const Moves& moves) {
  Assumption assumption{.name = name, .value = value, .sigma = sigma};
  if (!sigma) assumption.ordinary = ordinary;
  for (const ProjectedReading& one : projected) {
    const auto [moved_m, moved_px] = moves(one, sigma.value_or(ordinary));
    put_move(one, moved_m, moved_px, assumption);
  }
  if (!sigma)
    assumption.remedy = name.starts_with("beam") ? "use a rangefinder.yaml with covariance: alidade rangefinder"
                                                 : "use a camera file with covariance: alidade calibrate";
  return assumption;
}

void add_beam_assumptions(const Beam& beam, const Camera& camera, const std::vector<ProjectedReading>& projected,
                          std::vector<Assumption>& assumed) {
  constexpr double ordinary_origin_m = 0.005, ordinary_direction_rad = 0.003;
  const std::array<const char*, 5> names{"beam.origin_m x", "beam.origin_m y", "beam.origin_m z", "beam.direction u",
                                         "beam.direction v"};
  for (int i = 0; i < 5; ++i) {
    const auto moves = [&](const ProjectedReading& one, double error) {
      const Eigen::Vector3d moved_m = error * J_point_beam(beam, one.range_m).col(i);
      const auto seen = project_with_jacobians(camera, one.point.point_in_cam);
      return std::pair{moved_m, seen ? Eigen::Vector2d(seen->J_px_point * moved_m) : Eigen::Vector2d(0.0, 0.0)};
    };
    const auto sigma = beam.cov.isZero(0.0) ? std::nullopt : std::optional(std::sqrt(std::max(0.0, beam.cov(i, i))));
    assumed.push_back(assumption_of(names[static_cast<std::size_t>(i)], i < 3 ? beam.origin_in_cam[i] : 0.0, sigma,
                                    i < 3 ? ordinary_origin_m : ordinary_direction_rad, projected, moves));
  }
}

bool knows_covariance(const Camera& camera) {
  return camera.cov.rows() == params(camera.lens).size() && camera.cov.allFinite() && !camera.cov.isZero(0.0);
}

void add_camera_assumptions(const Camera& camera, const std::vector<ProjectedReading>& projected,
                            std::vector<Assumption>& assumed) {
  constexpr double ordinary_focal = 0.003, ordinary_centre_px = 2.0;
  const std::array<const char*, 4> names{"camera.fx", "camera.fy", "camera.cx", "camera.cy"};
  const Eigen::VectorXd lens = params(camera.lens);
  for (int i = 0; i < 4; ++i) {
    const auto moves = [&](const ProjectedReading& one, double error) {
      const auto seen = project_with_jacobians(camera, one.point.point_in_cam);
      return std::pair{Eigen::Vector3d(0.0, 0.0, 0.0),
                       seen ? Eigen::Vector2d(error * seen->J_px_params.col(i)) : Eigen::Vector2d(0.0, 0.0)};
    };
    const auto sigma = knows_covariance(camera) ? std::optional(std::sqrt(camera.cov(i, i))) : std::nullopt;
    assumed.push_back(assumption_of(names[static_cast<std::size_t>(i)], lens[i], sigma,
                                    i < 2 ? ordinary_focal * lens[i] : ordinary_centre_px, projected, moves));
  }
}

/// In which of focal lengths and centre the two are farther apart than calibrations of one camera are; empty: in none.
std::string difference_of(const Camera& a, const Camera& b) {
  if (a.width_px != b.width_px || a.height_px != b.height_px)
    return fmt::format("its images are {}x{}, not {}x{}", b.width_px, b.height_px, a.width_px, a.height_px);
  constexpr double sigmas = 5.0, usual_focal = 0.005, usual_centre_px = 5.0;  // of calibrations on two days
  const std::array<const char*, 4> names{"fx", "fy", "cx", "cy"};
  const Eigen::VectorXd first = params(a.lens), second = params(b.lens);
  for (int i = 0; i < 4; ++i) {
    const double variance = (knows_covariance(a) ? a.cov(i, i) : 0.0) + (knows_covariance(b) ? b.cov(i, i) : 0.0);
    const double usual = i < 2 ? usual_focal * first[i] : usual_centre_px;
    if (std::abs(second[i] - first[i]) > usual + sigmas * std::sqrt(variance))
      return fmt::format("its {} is {:.5g} px, not {:.5g}", names[static_cast<std::size_t>(i)], second[i], first[i]);
  }
  return "";
}

/// A beam belongs to the camera that it was calibrated with: another one gives other pixels.
void heed_other_camera(const ProjectConfig& config, const Camera& camera, Verdict& verdict) {
  if (!config.own_camera) return;
  const std::string difference = difference_of(*config.own_camera, camera);
  Check check{.name = "camera", .text = "the camera is the one that the beam was calibrated with"};
  if (!difference.empty()) {
    check.state = State::care;
    check.text = "this is not the camera that the beam was calibrated with: " + difference;
  }
  heed(check, "use " + (config.own_camera_name.empty() ? "that camera" : config.own_camera_name), verdict);
}

/// What the image shows: a lens is known where photos calibrated it, and its polynomials are anything beyond.
Check image_check(const Camera& camera, const std::vector<ProjectedReading>& projected) {
  Check check{.name = "in the image", .text = "all points are in the image"};
  std::size_t behind = 0, outside = 0;
  double first_m = 0.0;
  for (const ProjectedReading& one : projected) {
    const bool is_behind = !(one.point.point_in_cam.z() > 0.0) && !one.pixel;
    const bool is_outside = !is_behind && !(one.pixel && is_in_image(camera, one.pixel->px));
    if (behind + outside == 0 && (is_behind || is_outside)) first_m = one.range_m;
    (is_behind ? behind : outside) += is_behind || is_outside ? 1 : 0;
  }
  if (behind + outside == 0) return check;
  check.state = State::care;
  check.value = static_cast<double>(behind + outside);
  const std::size_t num = behind > 0 ? behind : outside;
  check.text =
      fmt::format("{} of {} point{} {} {}, the first at {:g} m", num, projected.size(),
                  projected.size() == 1 ? "" : "s", num == 1 ? "is" : "are",
                  behind > 0 ? "behind the camera" : "outside the image, where its lens is not calibrated", first_m);
  return check;
}

/// Readings that are all nearer than where the beam enters the image are no fault of it.
std::string remedy_of_image(const Beam& beam, const Camera& camera, const std::vector<ProjectedReading>& projected) {
  double range_m = 1e-6;  // then the farthest one outside
  for (const ProjectedReading& one : projected)
    if (!(one.pixel && is_in_image(camera, one.pixel->px))) range_m = std::max(range_m, one.range_m);
  for (; range_m < 100.0; range_m *= 1.02)
    if (const auto seen = measured_pixel(beam, camera, range_m); seen && is_in_image(camera, seen->px))
      return fmt::format("the beam is in the image from {:.2g} m on", range_m);
  return "check origin, direction and camera of the beam";
}

/// The same for the heads of a rig.
Check image_check(const Rig& rig, const std::vector<HeadProjection>& heads) {
  Check check{.name = "in the image", .text = "each head has the point in its image"};
  std::string without;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    if (heads[h].pixel && is_in_image(rig.heads[h].camera, heads[h].pixel->px)) continue;
    without += fmt::format("{}{}", without.empty() ? "" : ", ", heads[h].id);
    check.value += 1.0;
  }
  if (without.empty()) return check;
  check.state = State::care;
  check.text = "the point is not in the image of head " + without;
  return check;
}

/// How far the projection is from linear within σ of the point, over σ of the pixel; infinite where a point within σ is
/// not seen.
double nonlinearity_of(const Camera& camera, const ProjectedReading& one) {
  constexpr double small_px = 1.0;  // of a move: its curvature is less
  const SymmetricEigen3 axes = symmetric_eigen3(one.point.cov);
  double worst = 0.0;
  for (int i = 0; i < 3 && one.pixel; ++i) {
    const Eigen::Vector3d step = std::sqrt(std::max(0.0, axes.values[i])) * axes.vectors.col(i);
    const auto ahead = project(camera, one.point.point_in_cam + step);
    const auto back = project(camera, one.point.point_in_cam - step);
    if (!ahead || !back) return std::numeric_limits<double>::infinity();
    const double half = 0.5 * (*ahead - *back).norm(), curved = (0.5 * (*ahead + *back) - one.pixel->px).norm();
    const double linear = (project_with_jacobians(camera, one.point.point_in_cam)->J_px_point * step).norm();
    if (std::max(half, linear) > small_px)
      worst = std::max(worst, std::max(curved, std::abs(half - linear)) / std::max(linear, small_px));
  }
  return worst;
}

/// σ of a pixel is propagated linearly: it says nothing where the projection is not linear within it.
Check linear_check(const Beam& beam, const Camera& camera, const std::vector<ProjectedReading>& projected) {
  Check check{.name = "linear", .text = "σ is small enough to be propagated linearly", .limit = 0.3};
  check.value = std::sqrt(std::max(0.0, beam.cov.block<2, 2>(beam_direction_param, beam_direction_param).trace()));
  double at_m = projected.front().range_m;  // of a direction on a sphere
  for (const ProjectedReading& one : projected) {
    const double nonlinearity = nonlinearity_of(camera, one);
    if (!(nonlinearity > check.value)) continue;
    check.value = nonlinearity;
    at_m = one.range_m;
  }
  if (check.value <= check.limit) return check;
  check.state = State::care;
  check.text =
      fmt::format("σ of the point at {:g} m is too large for its pixel's σ, which is propagated linearly", at_m);
  check.value = std::min(check.value, 1e6);
  return check;
}

/// Lengths that no rangefinder beside a camera has: of another unit.
Check units_check(const Beam& beam, const std::vector<double>& ranges_m, std::optional<double> sigma_range_m) {
  Check check{.name = "units", .text = "origin and readings are such as metres give"};
  constexpr double far_m = 2.0;    // from the camera; an instrument and its camera are one thing
  constexpr double finest = 1e-5;  // σ of a reading over it: geodetic instruments come to there
  const double distance_m = beam.origin_in_cam.norm(), longest_m = std::ranges::max(ranges_m);
  const double sigma_m = sigma_range_m.value_or(beam.noise.sigma_at(longest_m));
  if (distance_m > far_m) {
    check.state = State::care;
    check.text = fmt::format("the beam's origin is {:.3g} m from the camera: origin_m is in metres", distance_m);
  } else if (sigma_m > 0.0 && sigma_m < finest * longest_m) {
    check.state = State::care;
    check.text = fmt::format("a reading of {:g} m with a σ of {:.2g} m: readings are in metres", longest_m, sigma_m);
  }
  return check;
}

void require_camera(const Camera& camera) {
  if (const std::string of_camera = fault(camera); !of_camera.empty()) throw ConfigError(of_camera);
}

void require_sense(const Beam& beam, const std::vector<double>& ranges_m) {
  if (const std::string of_beam = fault(beam); !of_beam.empty()) throw ConfigError(of_beam);
  if (ranges_m.empty()) throw ConfigError("there are no readings");
  for (const double range_m : ranges_m)
    if (!(range_m > 0.0 && range_m <= max_length_m))
      throw ConfigError(fmt::format("a reading of {:g} m is not within 0 to {:g}", range_m, max_length_m));
}

/// The value of head `h`: all heads' one, or its own.
double of_head(const std::vector<double>& values, std::size_t h) { return values[values.size() == 1 ? 0 : h]; }

void check_angles(const std::vector<double>& angles_rad, const char* option, std::size_t num_heads) {
  if (angles_rad.size() != 1 && angles_rad.size() != num_heads)
    throw ConfigError(fmt::format("{}: {} angles for {} heads; give one, or one for each (0.1,0.2)", option,
                                  angles_rad.size(), num_heads));
  for (const double angle : angles_rad) {
    if (!(std::abs(angle) <= 2.0 * std::numbers::pi))
      throw ConfigError(fmt::format("{}: {:g} is more than a turn; angles are radians", option, angle));
  }
}

/// Where a head sees a point, with its covariance; none: not in its view. `factor`: of the rig's errors.
std::optional<BeamPixel> pixel_of(const RigHead& rig_head, const Eigen::MatrixXd* factor,
                                  const Eigen::Vector2d& readings, const Eigen::Vector3d& point_in_world) {
  const auto seen = project(rig_head, readings, point_in_world);
  if (!seen) return std::nullopt;
  const double sigma = rig_head.head.encoder.sigma_rad;
  Eigen::Matrix2d cov = sigma * sigma * seen->J_px_readings * seen->J_px_readings.transpose();
  if (factor != nullptr) {
    const auto effect = rig_error_effect(*factor, TurnedHead(rig_head.head, readings), rig_head.camera, point_in_world,
                                         Eigen::Vector3d::Zero());
    if (effect) cov += *effect * effect->transpose();
  }
  return BeamPixel{seen->px, cov};
}

std::optional<Eigen::Matrix3d> covariance_of_point(const Rig& rig, const RigUncertainty& errors,
                                                   std::span<const HeadReading> readings,
                                                   const Eigen::Vector3d& point_in_world) {
  const auto by = meeting_sensitivity(rig.heads, readings, point_in_world, Eigen::Vector3d::Zero());
  if (by.empty()) return std::nullopt;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_errors = Eigen::MatrixXd::Zero(3, errors.num());
  for (std::size_t h = 0; h < by.size(); ++h) {
    if (by[h].size() == 0) continue;
    const Encoder& encoder = rig.heads[h].head.encoder;  // a reading errs as the other way the zero does
    cov += encoder.sigma_rad * encoder.sigma_rad * by[h].middleCols<2>(15) * by[h].middleCols<2>(15).transpose();
    if (errors.num() > 0) by_errors += by[h] * errors.factor[h];
  }
  cov += by_errors * by_errors.transpose();
  return cov;
}

/// What the files do not say of their own errors.
Check files_check(const Rig& rig) {
  Check check{.name = "covariance", .text = "heads and lenses come with their covariance"};
  std::string without = rig.cov.size() > 0 ? "" : "the rig";
  for (const RigHead& head : rig.heads) {
    if (head.camera.cov.rows() == params(head.camera.lens).size()) continue;
    without += (without.empty() ? "" : ", ") + fmt::format("the camera of head {}", head.head.id);
  }
  if (without.empty()) return check;
  check.state = State::care;
  check.text = without + ": given without covariance, whose errors are not in this σ";
  return check;
}

}  // namespace

FieldList fields_of(ProjectConfig& config) {
  return {{.name = "sigma_range_m",
           .value = &config.sigma_range_m,
           .help = "σ of a reading [m] (default: from the beam file)",
           .limits = {0.0, max_length_m, /*is_above_min=*/true},
           .option = "--sigma-range-m"}};
}

/// Whether errors of beam and lens can go together as the beam says: of the camera that it was calibrated with, not of
/// one that is known better, or of another calibration.
bool is_of_lens(const Beam& beam, const Camera& camera) {
  const Eigen::Index num_lens = camera.cov.rows();
  Eigen::MatrixXd joint(num_beam_params + num_lens, num_beam_params + num_lens);
  joint << beam.cov, beam.cov_with_lens, beam.cov_with_lens.transpose(), camera.cov;
  return is_covariance(joint);
}

BeamProjection project_readings(const Beam& beam, const Camera& camera, const std::vector<double>& ranges_m,
                                const ProjectConfig& config) {
  ProjectConfig used = config;
  const std::vector<std::string> found = faults_of(fields_of(used));
  if (!found.empty()) throw ConfigError(fmt::format("{}", fmt::join(found, "; ")));
  require_sense(beam, ranges_m);
  require_camera(camera);
  if (config.own_camera) require_camera(*config.own_camera);
  BeamProjection result{.readings = {}, .beam = beam, .camera = camera, .assumed = {}, .counts = {}, .verdict = {}};
  // A covariance with another lens' parameters is of another calibration.
  Eigen::MatrixXd& with_lens = result.beam.cov_with_lens;
  if (with_lens.cols() != camera.cov.cols()) with_lens.resize(0, 0);
  for (Eigen::Index k = 0; k < with_lens.cols(); ++k)
    if (camera.cov(k, k) == 0.0) with_lens.col(k).setZero();  // known exactly, as that file says
  const bool is_other_lens = with_lens.size() > 0 && !is_of_lens(result.beam, camera);
  if (is_other_lens) with_lens.resize(0, 0);
  for (const double range_m : ranges_m)
    result.readings.push_back({range_m, measured_point(result.beam, range_m, config.sigma_range_m),
                               measured_pixel(result.beam, camera, range_m, config.sigma_range_m)});
  const auto num_seen =
      std::ranges::count_if(result.readings, [](const ProjectedReading& one) { return one.pixel.has_value(); });
  result.counts.given = result.readings.size();
  result.counts.used = static_cast<std::size_t>(num_seen);
  result.verdict.sentence = fmt::format("{} of {} point{} a pixel", num_seen, result.readings.size(),
                                        result.readings.size() == 1 ? " has" : "s have");
  add_beam_assumptions(result.beam, camera, result.readings, result.assumed);
  add_camera_assumptions(camera, result.readings, result.assumed);
  heed(units_check(beam, ranges_m, config.sigma_range_m), "give lengths in metres: 2310 mm are --range 2.31",
       result.verdict);
  heed_other_camera(config, camera, result.verdict);
  heed(image_check(camera, result.readings), remedy_of_image(beam, camera, result.readings), result.verdict);
  heed(linear_check(beam, camera, result.readings), "use a beam that is better known, or a larger range",
       result.verdict);
  heed_assumptions(result.assumed, result.verdict);
  if (is_other_lens)
    heed({.name = "covariance",
          .state = State::care,
          .text = "the camera's covariance is not that of the beam's calibration: errors of both count as independent"},
         "give the camera.yaml that lies beside the beam's file", result.verdict);
  return result;
}

RigProjection project_rig(const Rig& rig, const std::vector<double>& pans_rad, const std::vector<double>& tilts_rad,
                          const std::optional<Eigen::Vector3d>& point_in_world) {
  if (const std::string of_rig = fault(rig); !of_rig.empty()) throw ConfigError(of_rig);
  if (rig.heads.empty()) throw ConfigError("the rig has no heads");
  if (!rig.intrinsics_histories.empty())
    throw ConfigError("intrinsics: change with time, which `project` is not given; give a camera");
  check_angles(pans_rad, "--pan", rig.heads.size());
  check_angles(tilts_rad, "--tilt", rig.heads.size());
  if (point_in_world && !(point_in_world->allFinite() && point_in_world->cwiseAbs().maxCoeff() <= max_length_m))
    throw ConfigError("the point must be finite, and within 1000 km");
  const RigUncertainty errors = rig_uncertainty(rig);
  RigProjection result;
  result.point_in_world = point_in_world;
  std::vector<HeadReading> seen_by;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const RigHead& rig_head = rig.heads[h];
    const Encoder& encoder = rig_head.head.encoder;
    HeadProjection head{.id = rig_head.head.id,
                        .pan_tilt_rad = {angle_near(of_head(pans_rad, h), encoder.pan_zero_rad),
                                         angle_near(of_head(tilts_rad, h), encoder.tilt_zero_rad)}};
    head.M = projection_matrix(rig_head, head.pan_tilt_rad);
    head.cam_centre_in_world = cam_centre_in_world(rig_head.head, head.pan_tilt_rad);
    if (point_in_world)
      head.pixel =
          pixel_of(rig_head, errors.num() > 0 ? &errors.factor[h] : nullptr, head.pan_tilt_rad, *point_in_world);
    if (head.pixel) seen_by.push_back({h, head.pan_tilt_rad});
    result.heads.push_back(std::move(head));
  }
  result.counts.given = result.counts.used = rig.heads.size();
  if (!point_in_world) {
    result.verdict.sentence = fmt::format("{} projection matrices", rig.heads.size());
    return result;
  }
  result.verdict.sentence = fmt::format("{} of {} heads have a pixel of the point", seen_by.size(), rig.heads.size());
  result.point_cov = covariance_of_point(rig, errors, seen_by, *point_in_world);
  heed(image_check(rig, result.heads), "check the angles and the point", result.verdict);
  heed(files_check(rig), "use files with their covariance: alidade calibrate and alidade rig write it", result.verdict);
  return result;
}

}  // namespace alidade
