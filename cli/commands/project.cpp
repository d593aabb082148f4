#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Eigenvalues>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/imaging/image_codecs.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"
#include "cli/commands/project_rig.h"

namespace alidade::cli {
namespace {

struct ProjectArgs {
  std::filesystem::path beam, camera, overlay;
  std::vector<double> ranges_m;
  double sigma_range_m = 0.0;
  RigProjectionArgs rig;
};

struct Projected {
  double range_m = 0.0;
  BeamPoint point;
  std::optional<BeamPixel> pixel;  ///< None: the camera does not see it.
};

/// Half axes and angle of the 3σ ellipse.
cv::RotatedRect ellipse_3sigma(const BeamPixel& pixel) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(pixel.cov);
  const Eigen::Vector2d sigma = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector2d along = axes.eigenvectors().col(1);
  return {cv::Point2f(static_cast<float>(pixel.px.x()), static_cast<float>(pixel.px.y())),
          cv::Size2f(static_cast<float>(6.0 * sigma[1]), static_cast<float>(6.0 * sigma[0])),
          static_cast<float>(std::atan2(along.y(), along.x()) * 180.0 / CV_PI)};
}

/// The photo with the beam's line from 0.1 m to beyond the farthest range, and each spot with its 3σ ellipse.
std::string overlay_png(const cv::Mat& photo, const Beam& beam, const Camera& camera,
                        const std::vector<Projected>& projected) {
  cv::Mat image;
  photo.convertTo(image, CV_8U, photo.depth() == CV_16U ? 1.0 / 257.0 : 1.0);
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  constexpr int shift = 4;
  const auto fixed = [](const Eigen::Vector2d& px) {
    return cv::Point(static_cast<int>(std::lround(px.x() * (1 << shift))),
                     static_cast<int>(std::lround(px.y() * (1 << shift))));
  };
  double farthest_m = 1.0;
  for (const Projected& one : projected) farthest_m = std::max(farthest_m, one.range_m);
  std::optional<Eigen::Vector2d> last;
  for (double range_m = 0.1; range_m < 3.0 * farthest_m; range_m *= 1.02) {
    const auto px = project(camera, point_at(beam, range_m));
    const bool is_near = px && (px->array().abs() < 1e5).all();
    if (is_near && last) cv::line(image, fixed(*last), fixed(*px), {0, 200, 255}, 1, cv::LINE_AA, shift);
    last = is_near ? px : std::nullopt;
  }
  for (const Projected& one : projected) {
    if (!one.pixel) continue;
    cv::ellipse(image, ellipse_3sigma(*one.pixel), {80, 255, 80}, 1, cv::LINE_AA);
    cv::drawMarker(image,
                   {static_cast<int>(std::lround(one.pixel->px.x())), static_cast<int>(std::lround(one.pixel->px.y()))},
                   {80, 255, 80}, cv::MARKER_CROSS, 9, 1, cv::LINE_AA);
  }
  return png_bytes(image);
}

DataTable points_table(const std::vector<Projected>& projected) {
  std::vector<std::vector<double>> column(15);
  for (const Projected& one : projected) {
    const Eigen::Vector3d& p = one.point.point_in_cam;
    const Eigen::Matrix3d& c = one.point.cov;
    const double none = std::nan("");
    const Eigen::Vector2d px = one.pixel ? one.pixel->px : Eigen::Vector2d(none, none);
    const Eigen::Matrix2d s = one.pixel ? one.pixel->cov : Eigen::Matrix2d(Eigen::Matrix2d::Constant(none));
    const std::array<double, 15> values{one.range_m, px.x(),  px.y(),  s(0, 0), s(0, 1), s(1, 1), p.x(),  p.y(),
                                        p.z(),       c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
    for (std::size_t i = 0; i < values.size(); ++i) column[i].push_back(values[i]);
  }
  static const std::array<const char*, 15> names{"range_m",
                                                 "u_px",
                                                 "v_px",
                                                 "cov_uu_px2",
                                                 "cov_uv_px2",
                                                 "cov_vv_px2",
                                                 "point_in_cam_x_m",
                                                 "point_in_cam_y_m",
                                                 "point_in_cam_z_m",
                                                 "cov_xx_m2",
                                                 "cov_xy_m2",
                                                 "cov_xz_m2",
                                                 "cov_yy_m2",
                                                 "cov_yz_m2",
                                                 "cov_zz_m2"};
  DataTable table{"points", {}};
  for (std::size_t i = 0; i < names.size(); ++i) table.columns.emplace_back(names[i], column[i]);
  return table;
}

std::string points_csv(const DataTable& table, std::size_t rows) {
  std::string text;
  for (const auto& [name, values] : table.columns) text += (text.empty() ? "" : ",") + name;
  text += "\n";
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
      const double value = std::get<std::vector<double>>(table.columns[k].second.content())[row];
      text += k == 0 ? "" : ",";
      if (std::isfinite(value)) text += fmt::format("{:.9g}", value);
    }
    text += "\n";
  }
  return text;
}

void describe(const std::vector<Projected>& projected, Run& run) {
  for (const Projected& one : projected) {
    const Eigen::Vector3d& p = one.point.point_in_cam;
    const Eigen::Vector3d sigma = 3.0 * one.point.cov.diagonal().cwiseSqrt();
    const std::string pixel = one.pixel ? fmt::format("u {:.2f} ± {:.2g}  v {:.2f} ± {:.2g} px", one.pixel->px.x(),
                                                      3.0 * std::sqrt(one.pixel->cov(0, 0)), one.pixel->px.y(),
                                                      3.0 * std::sqrt(one.pixel->cov(1, 1)))
                                        : "not in the camera's sight";
    run.say(fmt::format("{:.4g} m: {}   x {:.4f} ± {:.2g}  y {:.4f} ± {:.2g}  z {:.4f} ± {:.2g} m   (3σ)", one.range_m,
                        pixel, p.x(), sigma.x(), p.y(), sigma.y(), p.z(), sigma.z()));
  }
}

JsonValue rows_of(const Eigen::MatrixXd& matrix) {
  JsonValue rows = JsonValue::list();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    std::vector<double> row;
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// The first range under the names of a single answer.
void fill_first(const Projected& first, ResultDocument& document) {
  const Eigen::Vector3d& p = first.point.point_in_cam;
  document.estimate["point_in_cam_m"] = std::vector<double>{p.x(), p.y(), p.z()};
  document.estimate["point_cov_m2"] = rows_of(first.point.cov);
  const Eigen::Vector3d sigma_m = first.point.cov.diagonal().cwiseSqrt();
  document.stddev["point_in_cam_m"] = std::vector<double>{sigma_m.x(), sigma_m.y(), sigma_m.z()};
  if (!first.pixel) return;
  document.estimate["px"] = std::vector<double>{first.pixel->px.x(), first.pixel->px.y()};
  document.estimate["px_cov_px2"] = rows_of(first.pixel->cov);
  document.stddev["px"] = std::vector<double>{std::sqrt(first.pixel->cov(0, 0)), std::sqrt(first.pixel->cov(1, 1))};
}

/// By how much of its own σ a pixel or a point moves at most, and which.
void put_move(const Projected& one, const Eigen::Vector3d& moved_m, const Eigen::Vector2d& moved_px,
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

/// One thing taken as given, and what its σ, or an ordinary error, moves of every point and pixel.
template <class Moves>
Assumption assumption_of(const std::string& name, double value, std::optional<double> sigma, double ordinary,
                         const std::vector<Projected>& projected, const Moves& moves) {
  Assumption assumption{.name = name, .value = value, .sigma = sigma};
  if (!sigma) assumption.ordinary = ordinary;
  for (const Projected& one : projected) {
    const auto [moved_m, moved_px] = moves(one, sigma.value_or(ordinary));
    put_move(one, moved_m, moved_px, assumption);
  }
  if (!sigma)
    assumption.remedy = name.starts_with("beam") ? "use a rangefinder.yaml with covariance: alidade rangefinder"
                                                 : "use a camera file with covariance: alidade calibrate";
  return assumption;
}

void add_beam_assumptions(const Beam& beam, const Camera& camera, const std::vector<Projected>& projected,
                          std::vector<Assumption>& assumed) {
  constexpr double ordinary_origin_m = 0.005, ordinary_direction_rad = 0.003;
  const std::array<const char*, 5> names{"beam.origin_m x", "beam.origin_m y", "beam.origin_m z", "beam.direction u",
                                         "beam.direction v"};
  for (int i = 0; i < 5; ++i) {
    const auto moves = [&](const Projected& one, double error) {
      const Eigen::Vector3d moved_m = error * J_point_beam(beam, one.range_m).col(i);
      const auto seen = project_with_jacobians(camera, one.point.point_in_cam);
      return std::pair{moved_m, seen ? Eigen::Vector2d(seen->J_px_point * moved_m) : Eigen::Vector2d(0.0, 0.0)};
    };
    const std::optional<double> sigma =
        beam.cov.isZero(0.0) ? std::nullopt : std::optional(std::sqrt(std::max(0.0, beam.cov(i, i))));
    assumed.push_back(assumption_of(names[static_cast<std::size_t>(i)], i < 3 ? beam.origin_in_cam[i] : 0.0, sigma,
                                    i < 3 ? ordinary_origin_m : ordinary_direction_rad, projected, moves));
  }
}

bool knows_covariance(const Camera& camera) {
  return camera.cov.rows() == params(camera.lens).size() && camera.cov.allFinite() && !camera.cov.isZero(0.0);
}

void add_camera_assumptions(const Camera& camera, const std::vector<Projected>& projected,
                            std::vector<Assumption>& assumed) {
  constexpr double ordinary_focal = 0.003, ordinary_centre_px = 2.0;
  const std::array<const char*, 4> names{"camera.fx", "camera.fy", "camera.cx", "camera.cy"};
  const Eigen::VectorXd lens = params(camera.lens);
  for (int i = 0; i < 4; ++i) {
    const auto moves = [&](const Projected& one, double error) {
      const auto seen = project_with_jacobians(camera, one.point.point_in_cam);
      return std::pair{Eigen::Vector3d(0.0, 0.0, 0.0),
                       seen ? Eigen::Vector2d(error * seen->J_px_params.col(i)) : Eigen::Vector2d(0.0, 0.0)};
    };
    const std::optional<double> sigma =
        knows_covariance(camera) ? std::optional(std::sqrt(camera.cov(i, i))) : std::nullopt;
    assumed.push_back(assumption_of(names[static_cast<std::size_t>(i)], lens[i], sigma,
                                    i < 2 ? ordinary_focal * lens[i] : ordinary_centre_px, projected, moves));
  }
}

/// Beam and camera are taken as given: with their covariance, which is counted, or without, which is said.
void heed_files(const Beam& beam, const Camera& camera, const std::vector<Projected>& projected, Run& run,
                Verdict& verdict) {
  add_beam_assumptions(beam, camera, projected, run.document.assumed);
  add_camera_assumptions(camera, projected, run.document.assumed);
  if (beam.cov.isZero(0.0)) run.say("the beam's file has no covariance: σ is that of the reading alone");
  if (!knows_covariance(camera)) run.say("the camera's file has no covariance: its error is not in σ");
  heed_assumptions(run.document.assumed, verdict);
}

/// In which of focal lengths and centre the two are farther apart than calibrations of one camera are; empty: in none.
std::string difference_of(const Camera& a, const Camera& b) {
  if (a.width_px != b.width_px || a.height_px != b.height_px)
    return fmt::format("its pictures are {}x{}, not {}x{}", b.width_px, b.height_px, a.width_px, a.height_px);
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

/// A beam stands in the camera that it was calibrated with: through another one its pixels are elsewhere.
void heed_other_camera(const std::filesystem::path& own, const std::filesystem::path& used, const Camera& camera,
                       Verdict& verdict) {
  if (own.empty() || own == used || !std::filesystem::exists(own)) return;
  const std::string difference = difference_of(read_central_camera(own), camera);
  Check check{.name = "camera", .text = "the camera is the one that the beam was calibrated with"};
  if (!difference.empty()) {
    check.state = State::care;
    check.text = "this is not the camera that the beam was calibrated with: " + difference;
  }
  heed(check, "use " + own.string(), verdict);
}

ExitCode project_beam(const ProjectArgs& args, Run& run) {
  run.add_input("beam", args.beam);
  const BeamFile file = read_beam(args.beam);
  const std::filesystem::path camera_file = args.camera.empty() ? file.camera : args.camera;
  if (camera_file.empty()) throw UsageError("the beam names no camera; say --camera FILE");
  run.add_input("camera", camera_file);
  const Camera camera = read_central_camera(camera_file);
  Beam beam = file.beam;
  // A covariance with another lens' parameters is of another calibration.
  if (beam.cov_with_lens.cols() != camera.cov.cols()) beam.cov_with_lens.resize(0, 0);
  std::vector<Projected> projected;
  const std::optional<double> sigma_m = args.sigma_range_m > 0.0 ? std::optional(args.sigma_range_m) : std::nullopt;
  for (const double range_m : args.ranges_m)
    projected.push_back(
        {range_m, measured_point(beam, range_m, sigma_m), measured_pixel(beam, camera, range_m, sigma_m)});
  const DataTable table = points_table(projected);
  run.add_file("points.csv", points_csv(table, projected.size()));
  run.document.data.push_back(table);
  run.document.counts.given = projected.size();
  const auto num_seen = std::ranges::count_if(projected, [](const Projected& one) { return one.pixel.has_value(); });
  run.document.counts.used = static_cast<std::size_t>(num_seen);
  fill_first(projected.front(), run.document);
  describe(projected, run);
  if (!args.overlay.empty()) {
    const std::string bytes = read_file(args.overlay);
    run.add_input("photo", args.overlay.string(), bytes);
    const cv::Mat photo = decode_photo(bytes, args.overlay.string());
    if (photo.cols != camera.width_px || photo.rows != camera.height_px)
      throw InputError(fmt::format("{}: is {}x{}, the camera is for {}x{}", args.overlay.string(), photo.cols,
                                   photo.rows, camera.width_px, camera.height_px));
    run.add_file("overlay.png", overlay_png(photo, beam, camera, projected));
    run.say("overlay: " + (run.options.out / "overlay.png").string());
  }
  Verdict verdict;
  verdict.sentence = fmt::format("{} of {} point{} in the picture's model", num_seen, projected.size(),
                                 projected.size() == 1 ? "" : "s");
  heed_files(beam, camera, projected, run, verdict);
  heed_other_camera(file.camera, camera_file, camera, verdict);
  return run.finish(verdict);
}

/// Which of the two it is, and whether its options are there.
ExitCode project(const ProjectArgs& args, Run& run) {
  if (!args.rig.rig.empty()) {
    if (!args.beam.empty() || !args.ranges_m.empty()) throw UsageError("--rig and --beam are two different questions");
    if (args.rig.pans_rad.empty() || args.rig.tilts_rad.empty()) throw UsageError("--rig needs --pan and --tilt");
    return project_rig(args.rig, run);
  }
  if (args.beam.empty()) throw UsageError("give --beam FILE with --range, or --rig FILE with --pan and --tilt");
  if (args.ranges_m.empty()) throw UsageError("--beam needs --range");
  if (!args.rig.pans_rad.empty() || !args.rig.tilts_rad.empty() || !args.rig.point_m.empty())
    throw UsageError("--pan, --tilt and --point belong to --rig");
  return project_beam(args, run);
}

}  // namespace

void add_project(App& app) {
  auto args = std::make_shared<ProjectArgs>();
  CLI::App& command = app.add_command(
      {.name = "project",
       .summary = "Pixel and 3-D point of a rangefinder's reading, or matrices and pixels of a pan-tilt rig",
       .examples = "alidade project --beam rangefinder.yaml --camera camera.yaml --range 2.31\n"
                   "alidade project --beam rangefinder.yaml --range 0.5,1,2,4 --overlay photo.jpg\n"
                   "alidade project --rig rig.yaml --pan 0.1,-0.2 --tilt 0.2 --point 0.1 -0.3 2.5\n"},
      [args](Run& run) { return project(*args, run); });
  command.add_option("--beam", args->beam, "rangefinder.yaml of alidade rangefinder")->type_name("FILE");
  command.add_option("--camera", args->camera, "The camera (default: the one that the beam names)")->type_name("FILE");
  command.add_option("--range", args->ranges_m, "Reading, or several [m]")->delimiter(',')->check(positive_number());
  command.add_option("--sigma-range-m", args->sigma_range_m, "σ of the reading [m] (default: the beam's)")
      ->check(positive_number());
  command.add_option("--overlay", args->overlay, "Draw the beam's line and the spots into this photo: overlay.png")
      ->type_name("PHOTO");
  command.add_option("--rig", args->rig.rig, "rig.yaml of alidade rig")->type_name("FILE");
  command.add_option("--pan", args->rig.pans_rad, "What the pan encoders read, one for all or one for each head [rad]")
      ->delimiter(',')
      ->check(finite_number());
  command.add_option("--tilt", args->rig.tilts_rad, "What the tilt encoders read [rad]")
      ->delimiter(',')
      ->check(finite_number());
  command.add_option("--point", args->rig.point_m, "X Y Z in the rig's world [m]: gives its pixels")
      ->expected(3)
      ->check(finite_number());
}

}  // namespace alidade::cli
