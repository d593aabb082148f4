#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace cv {
class Mat;
}

/// The input of localize(): observations of numbered points, or images.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A point seen: which one, where. σ of each coordinate; 0: the config's.
struct FeatureObservation {
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;
};

/// What was seen of numbered points in one image.
struct ObservationFrame {
  long frame = 0;
  double t_s = 0.0;
  std::vector<FeatureObservation> observations;
};

/// Frames in order of time, also those in which nothing was seen, and rows of their table that were rejected.
struct ObservationTable {
  std::vector<ObservationFrame> frames = {};
  std::vector<SkippedInput> skipped = {};
};

/// The next image, 8-bit grey, its number and time. False at the end.
using NextImage = std::function<bool(cv::Mat& grey, long& frame, double& t_s)>;

/// Images in order of time.
struct ImageStream {
  NextImage next;
  std::size_t num_images = 0;  ///< For progress; 0: not known.
  /// Frames a second by the video's own times, of what has been read, where a rate was given instead of them; 0: none.
  std::function<double()> own_rate_hz = {};
};

/// A feature searched for in an image: for drawing.
struct ObservationTried {
  long id = 0;
  Eigen::Vector2d expected_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Identity();  ///< Covariance of the innovation [px²].
  std::optional<Eigen::Vector2d> found_px;
  bool is_used = false;
};

/// A pose at a time.
struct TimedPose {
  double t_s = 0.0;
  Rigid3 world_from_cam;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
