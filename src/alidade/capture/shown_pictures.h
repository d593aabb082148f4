#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "alidade/board/board_view.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A picture that could have been taken and was not: others told more at its time.
struct ShownPicture {
  BoardView view;
  std::shared_ptr<const cv::Mat> picture;  ///< Null where corners alone came.
  double t_s = 0.0;
  double gain = 0.0;  ///< As valued last.
};

/// The most telling of the pictures that were shown, each pose once: who is not led by the outline shows good poses and
/// goes on, and which were good is known only afterwards.
class ShownPictures {
 public:
  /// Keeps a copy of the picture, if no other like it is held and few enough are held that tell more.
  void offer(const BoardView& view, const cv::Mat* picture, double t_s, double gain);
  /// Values all of them anew, by what they would bring now; those for which `is_kept` holds go.
  void value(const std::function<double(const BoardView&)>& gain_of,
             const std::function<bool(const BoardView&)>& is_kept);
  /// Forgets a picture that turned out to be of no use.
  void drop(const cv::Mat& picture);
  /// None where there are none.
  [[nodiscard]] const ShownPicture* best() const;
  [[nodiscard]] std::size_t size() const { return shown_.size(); }

 private:
  std::vector<ShownPicture> shown_;
};

}  // namespace alidade
