#pragma once

#include <filesystem>
#include <vector>

#include "alidade/io/video.h"
#include "alidade/localize/image_target.h"

namespace alidade {

/// Pictures with their times, for `localize`: a folder of numbered pictures, a video, or a folder in EuRoC's layout
/// (`mav0/cam0/data` with `data.csv`, times in ns; M. Burri et al., IJRR 35(10), 2016).
class ImageSequence {
 public:
  /// `rate_hz`: time of a frame is its number over this, the first at 0; not needed where data.csv has times. Throws
  /// InputError: no such thing, no pictures, no times, times that run backwards, a picture that data.csv does not name.
  ImageSequence(const std::filesystem::path& path, double rate_hz, int width_px, int height_px);

  /// Whether a path is pictures, or a table of sights.
  [[nodiscard]] static bool is_pictures(const std::filesystem::path& path);
  /// The next picture, 8-bit grey. False at the end. Throws InputError: not a picture, not of the camera's size.
  [[nodiscard]] bool next(cv::Mat& grey, long& frame, double& t_s);
  [[nodiscard]] std::size_t num_pictures() const { return frames_.num_frames(); }

 private:
  VideoFrames frames_;
  std::vector<double> times_s_;  ///< One a picture; empty: number over rate.
  double rate_hz_;
  int width_px_, height_px_;
  std::size_t count_ = 0;
};

/// Reads target.yaml for pictures: `rectangle: {width_m, height_m, sigma_m}`, `board: {corners, square_m}`, or `points`
/// of which each has a `patch`, a small grey picture of it, relative to the file.
[[nodiscard]] ImageTarget read_image_target(const std::filesystem::path& file);

}  // namespace alidade
