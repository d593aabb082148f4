#pragma once

#include <map>
#include <string>

#include "alidade/io/result_document.h"
#include "alidade/localize/localize_images.h"

namespace alidade {

/// Some pictures of a run, evenly spread over it, with what was looked for in them: for its page.
class SeenFrames {
 public:
  /// `num_pictures` of the run; 0: not known. Without a page no picture is kept, only what was looked for.
  SeenFrames(std::size_t num_pictures, bool keeps_pictures);

  void offer(double t_s, const cv::Mat& picture, std::span<const SightTried> tried);
  /// Adds the tables `frames` (t_s, name of the picture, its size) and `sights` (where a point was expected, the
  /// covariance of the innovation, where it was found); neither where no picture came.
  void fill(ResultDocument& document) const;
  /// JPEG by name.
  [[nodiscard]] const std::map<std::string, std::string>& pictures() const { return pictures_; }

 private:
  struct Frame {
    double t_s;
    std::string name;
    int width_px, height_px;  ///< Of the picture in which pixels are counted; the JPEG may be smaller.
    std::vector<SightTried> tried;
  };
  std::size_t count_ = 0, every_ = 1;
  bool keeps_pictures_;
  std::vector<Frame> frames_;
  std::map<std::string, std::string> pictures_;
};

}  // namespace alidade
