#pragma once

#include <filesystem>
#include <vector>

#include "alidade/images/video.h"
#include "alidade/localize/image_target.h"

namespace alidade {

/// Images with their times, for `localize`: a folder of numbered images, a video, or a folder in EuRoC's layout
/// (`mav0/cam0/data` with `data.csv`, times in ns; M. Burri et al., IJRR 35(10), 2016).
class ImageSequence {
 public:
  /// `rate_hz`: time of a frame is its number over this, the first at 0; not needed where data.csv has times. Throws
  /// InputError: no such thing, no images, no times, times that run backwards, an image that data.csv does not name.
  ImageSequence(const std::filesystem::path& path, double rate_hz, int width_px, int height_px);

  /// Whether a path is images, or a table of observations.
  [[nodiscard]] static bool is_images(const std::filesystem::path& path);
  /// The next image, 8-bit grey. False at the end. Throws InputError: not an image, not of the camera's size.
  [[nodiscard]] bool next(cv::Mat& grey, long& frame, double& t_s);
  [[nodiscard]] std::size_t num_images() const { return frames_.num_frames(); }

 private:
  VideoFrames frames_;
  std::vector<double> times_s_;  ///< One an image; empty: number over rate.
  double rate_hz_;
  int width_px_, height_px_;
  std::size_t count_ = 0;
};

/// Reads target.yaml for images: `rectangle: {width_m, height_m, sigma_m}`, `board: {corners, square_m}`, or `points`
/// of which each has a `patch`, a small grey image of it, relative to the file.
[[nodiscard]] ImageTarget read_image_target(const std::filesystem::path& file);

}  // namespace alidade
