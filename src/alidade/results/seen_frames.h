#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "alidade/localize/sequence.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Some images of a run, evenly spread over it, with what was looked for in them: for its page.
class SeenFrames {
 public:
  /// `num_images` of the run; 0: not known. Without a page no image is kept, only what was looked for.
  SeenFrames(std::size_t num_images, bool keeps_images);

  /// For LocalizeConfig::watch_image.
  void offer(double t_s, const cv::Mat& image, std::span<const ObservationTried> tried);
  /// Puts the tables `frames` (t_s, name of the image, its size) and `observations` (where a point was expected, the
  /// covariance of the innovation, where it was found) before the others, and adds the images; nothing where no image
  /// came.
  void add_to(JobOutcome& outcome) const;
  [[nodiscard]] std::size_t num_images() const { return images_.size(); }

 private:
  [[nodiscard]] DataTable observations_table() const;
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

ALIDADE_PUBLIC_END
}  // namespace alidade
