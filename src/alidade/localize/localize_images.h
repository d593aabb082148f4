#pragma once

#include <functional>

#include "alidade/localize/image_target.h"
#include "alidade/localize/localize.h"

namespace cv {
class Mat;
}

namespace alidade {

/// How features are chosen, found again and given up.
struct EyesConfig {
  std::size_t min_found = 30;  ///< New ones are added while fewer are found in an image.
  std::size_t max_tried = 40;  ///< Looked for in an image, the oldest first: they drift least.
  std::size_t max_new = 8;     ///< In an image, after the first.
  std::size_t max_features = 120;
  /// Least σ of a match's coordinate: what patches of things with depth, seen through a lens that is not quite as
  /// calibrated, are off by, however well they fit.
  double sigma_floor_px = 0.11;
  double min_correlation = 0.8;
  double min_found_share = 0.5;  ///< Features that are found less often leave.
  int cell_px = 0;               ///< Of the grid on which new ones are chosen; 0: a tenth of the image's width.
  double near_share = 0.15;      ///< Distance between keyframes over that of the map's points,
  double near_rad = 0.15;        ///< and angle.
};

/// A feature looked for in an image: for those who draw it.
struct ObservationTried {
  long id = 0;
  Eigen::Vector2d expected_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
  std::optional<Eigen::Vector2d> found_px;
  bool is_used = false;
};

struct LocalizeImagesConfig {
  LocalizeConfig localize;  ///< `target` is not looked at: ImageTarget's points are taken.
  EyesConfig eyes;
  std::optional<ImageTarget> target;  ///< None: the world is the first camera, scale unknown.
  /// Is given what was matched before the filter sees it, and may change it.
  std::function<void(long frame, std::vector<FeatureObservation>&)> disturb = {};
  /// Is shown each image with what was looked for in it, before `localize.watch` its row.
  std::function<void(long frame, const cv::Mat&, std::span<const ObservationTried>)> watch = {};
};

/// The next image, 8-bit grey, its number and time. False at the end.
using NextImage = std::function<bool(cv::Mat& grey, long& frame, double& t_s)>;

/// The path of a camera through images, in order of time. `num_images`: for progress; 0: not known.
[[nodiscard]] LocalizeReport localize_images(const Camera& camera, const NextImage& next, std::size_t num_images,
                                             const LocalizeImagesConfig& config, std::span<const TimedPose> truth = {},
                                             const Progress& progress = {});

}  // namespace alidade
