#pragma once

#include <map>
#include <string>

#include "alidade/localize/localize_images.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Some images of a run, evenly spread over it, with what was looked for in them: for its page.
class SeenFrames {
 public:
  /// `num_images` of the run; 0: not known. Without a page no image is kept, only what was looked for.
  SeenFrames(std::size_t num_images, bool keeps_images);

  void offer(double t_s, const cv::Mat& image, std::span<const ObservationTried> tried);
  /// Adds the tables `frames` (t_s, name of the image, its size) and `observations` (where a point was expected, the
  /// covariance of the innovation, where it was found); neither where no image came.
  void fill(ResultDocument& document) const;
  /// JPEG by name.
  [[nodiscard]] const std::map<std::string, std::string>& images() const { return images_; }

 private:
  struct Frame {
    double t_s;
    std::string name;
    int width_px, height_px;  ///< Of the image in which pixels are counted; the JPEG may be smaller.
    std::vector<ObservationTried> tried;
  };
  std::size_t count_ = 0, every_ = 1;
  bool keeps_images_;
  std::vector<Frame> frames_;
  std::map<std::string, std::string> images_;
};

}  // namespace alidade
