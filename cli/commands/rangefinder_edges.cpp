#include "cli/commands/rangefinder_edges.h"

#include <fmt/format.h>

#include <opencv2/core.hpp>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/tables/scan_file.h"

namespace alidade::cli {
namespace {

GreyImage grey_image(const std::filesystem::path& file, const Camera& camera, Run& run) {
  const std::string bytes = read_file(file);
  run.add_input("photo", file.string(), bytes);
  std::string reason;
  const cv::Mat grey = to_grey_photo(decode_photo(bytes, file.string()), reason);
  if (grey.empty()) throw InputError(file.string() + ": " + reason);
  if (grey.cols != camera.width_px || grey.rows != camera.height_px)
    throw InputError(fmt::format("{}: is {}x{}, the camera is for {}x{}", file.string(), grey.cols, grey.rows,
                                 camera.width_px, camera.height_px));
  GreyImage image{grey.cols, grey.rows, {}};
  for (int row = 0; row < grey.rows; ++row)
    image.values.insert(image.values.end(), grey.ptr<float>(row), grey.ptr<float>(row) + grey.cols);
  return image;
}

}  // namespace

ExitCode align_scan(const EdgesArgs& args, Run& run) {
  if (args.photo.empty()) throw UsageError("--method edges needs --photo");
  run.add_input("scan", args.scan);
  run.add_input("camera", args.camera);
  const std::vector<ScanRow> scan = read_scan(args.scan);
  const Camera camera = read_central_camera(args.camera);
  Beam start;
  if (!args.start.empty()) {
    run.add_input("start", args.start);
    start = read_beam(args.start).beam;
  }
  EdgesConfig config;
  constexpr double usual_width_px = 640.0;  // of the images that the blurs are meant for
  for (double& blur_px : config.blur_px) blur_px *= camera.width_px / usual_width_px;
  const EdgesReport report =
      align_edges(scan, grey_image(args.photo, camera, run), camera, start, config, run.progress);
  run.lap("align");
  const Verdict verdict = edges_verdict(report);
  run.document.counts.given = scan.size();
  run.document.counts.used = static_cast<std::size_t>(report.num_edges);
  JsonValue& estimate = run.document.estimate;
  const Eigen::Vector3d &o = report.beam.origin_in_cam, &a = report.beam.direction_in_cam;
  estimate["method"] = "edges";
  estimate["origin_m"] = std::vector<double>{o.x(), o.y(), o.z()};
  estimate["direction"] = std::vector<double>{a.x(), a.y(), a.z()};
  estimate["theta_x_rad"] = direction_angles_rad(report.beam).x();
  estimate["theta_y_rad"] = direction_angles_rad(report.beam).y();
  const Eigen::Matrix<double, 7, 7> cov = embedded_covariance(report.beam);
  const auto sigma = [&](int i) { return std::sqrt(cov(i, i)); };
  run.document.stddev["origin_m"] = std::vector<double>{sigma(0), sigma(1), sigma(2)};
  run.document.stddev["direction"] = std::vector<double>{sigma(3), sigma(4), sigma(5)};
  estimate["gain"] = report.gain;
  estimate["halves_differ_rad"] = report.halves_differ_rad;
  if (has_estimate(verdict)) {
    run.say(fmt::format(
        "direction {:.5f} ± {:.2g}  {:.5f} ± {:.2g}  {:.5f} ± {:.2g} (3σ); the halves of the scan "
        "differ by {:.2g} mrad",
        a.x(), 3.0 * sigma(3), a.y(), 3.0 * sigma(4), a.z(), 3.0 * sigma(5), 1e3 * report.halves_differ_rad));
    run.add_file("rangefinder.yaml", beam_text(report.beam, camera, "camera.yaml"));
    run.add_file("camera.yaml", camera_text(camera, CameraFormat::alidade));
  }
  return run.finish(verdict);
}

}  // namespace alidade::cli
