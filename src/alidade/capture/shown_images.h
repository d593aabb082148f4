#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "alidade/board/board_view.h"

namespace cv {
class Mat;
}

namespace alidade {

/// An image that could have been taken and was not: others were more informative then.
struct ShownImage {
  BoardView view;
  std::shared_ptr<const cv::Mat> image;  ///< Null where corners alone came.
  double t_s = 0.0;
  double gain = 0.0;  ///< As valued last.
};

/// The most informative of the images shown, one per pose: a user who ignores the outline passes good poses, and which
/// were good is known only afterwards.
class ShownImages {
 public:
  /// Keeps a copy of the image, if no other like it is kept and few enough that are more informative.
  void offer(const BoardView& view, const cv::Mat* image, double t_s, double gain);
  /// Values all of them again, by what they would bring now; those for which `is_kept` holds go.
  void value(const std::function<double(const BoardView&)>& gain_of,
             const std::function<bool(const BoardView&)>& is_kept);
  /// Forgets an image that turned out to be of no use.
  void drop(const cv::Mat& image);
  /// None where there are none.
  [[nodiscard]] const ShownImage* best() const;
  [[nodiscard]] std::size_t size() const { return shown_.size(); }

 private:
  std::vector<ShownImage> shown_;
};

}  // namespace alidade
