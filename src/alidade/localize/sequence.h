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

/// An observation of a point: its id and pixel. σ applies to each coordinate; 0: the config's.
struct FeatureObservation {
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;
};

/// The observations of numbered points in one image.
struct ObservationFrame {
  long frame = 0;
  double t_s = 0.0;
  std::vector<FeatureObservation> observations;
};

/// Frames in order of time, including those without observations, and the rejected rows of their table.
struct ObservationTable {
  std::vector<ObservationFrame> frames = {};
  std::vector<SkippedInput> skipped = {};
};

/// Reads the next image (8-bit grey), its number and its time; returns false at the end.
using NextImage = std::function<bool(cv::Mat& grey, long& frame, double& t_s)>;

/// Images in order of time.
struct ImageStream {
  NextImage next;
  std::size_t num_images = 0;  ///< Total, for progress reports; 0: not known.
  /// Rate by the video's own times so far [frames/s], where a given rate was used instead of them; 0: none.
  std::function<double()> own_rate_hz = {};
};

/// A feature searched for in an image, for display.
struct ObservationTried {
  long id = 0;
  Eigen::Vector2d expected_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Identity();  ///< Covariance of the innovation [px²].
  std::optional<Eigen::Vector2d> found_px;
  bool is_used = false;
};

/// A pose and its time.
struct TimedPose {
  double t_s = 0.0;
  Rigid3 world_from_cam;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
