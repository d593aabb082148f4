#include "alidade/localize/localize_images.h"

#include <opencv2/core.hpp>

#include "alidade/localize/image_localizer.h"
#include "alidade/localize/summary.h"

namespace alidade {

LocalizeReport localize_images(const Camera& camera, const NextImage& next, std::size_t num_images,
                               const LocalizeImagesConfig& config, std::span<const TimedPose> truth,
                               const Progress& progress) {
  LocalizeReport report;
  report.camera = camera;
  report.is_of_images = true;
  report.has_target = config.target.has_value();
  report.scale_known = report.has_target;
  ImageLocalizer localizer(camera, config);
  cv::Mat grey;
  long frame = 0;
  double t_s = 0.0;
  while (next(grey, frame, t_s)) {
    report_progress(progress, "localize", report.path.size(), std::max(num_images, report.path.size() + 1));
    const double begin_s = config.localize.seconds ? config.localize.seconds() : 0.0;
    report.path.push_back(localizer.take(grey, frame, t_s));
    if (config.localize.seconds) report.path.back().seconds = config.localize.seconds() - begin_s;
    if (config.watch) config.watch(frame, grey, localizer.tried());
    if (config.localize.watch) config.localize.watch(report.path.back());
  }
  report.num_restarts = localizer.num_restarts();
  sum_up(
      localizer.bank(), [&](long id) { return localizer.num_found(id); }, truth, report);
  report.known_shift = known_shift(report.map, localizer.told());
  report.radial = localizer.residuals().structure();
  report.given = localizer.given().numbers();
  report.num_alike = localizer.num_alike();
  report.sigma_px = config.eyes.sigma_floor_px;
  return report;
}

}  // namespace alidade
