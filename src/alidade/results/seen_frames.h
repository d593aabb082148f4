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

/// Some images of a run, evenly spread over it, with the features searched for in them: for the report.
class SeenFrames {
 public:
  /// `num_images` in the run; 0: not known. Without `keeps_images` only the searches are stored, not the images.
  SeenFrames(std::size_t num_images, bool keeps_images);

  /// To be called by LocalizeConfig::watch_image.
  void offer(double t_s, const cv::Mat& image, std::span<const ObservationTried> tried);
  /// Inserts the tables `frames` (t_s, name of the image, its size) and `observations` (expected pixel of a point,
  /// covariance of the innovation, detected pixel) before the others, and adds the images. It does nothing if no image
  /// was offered.
  void add_to(JobOutcome& outcome) const;
  [[nodiscard]] std::size_t num_images() const { return images_.size(); }

 private:
  [[nodiscard]] DataTable observations_table() const;
  struct Frame {
    double t_s;
    std::string name;
    int width_px, height_px;  ///< Size of the image that the pixels refer to; the JPEG may be smaller.
    std::vector<ObservationTried> tried;
  };
  std::size_t count_ = 0, every_ = 1;
  bool keeps_images_;
  std::vector<Frame> frames_;
  std::map<std::string, std::string> images_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
