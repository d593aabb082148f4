#include "alidade/target/target_detector.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "alidade/board/dictionary.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/target/target_search.h"

namespace alidade {
namespace {

void check_colour(const Eigen::Vector3d& rgb) {
  constexpr double min_chroma = 30.0;  // of 255: below it hue is noise
  if (!rgb.allFinite() || rgb.minCoeff() < 0.0 || rgb.maxCoeff() > 255.0)
    throw std::invalid_argument("a colour has three values of 0 to 255");
  if (rgb.maxCoeff() - rgb.minCoeff() < min_chroma)
    throw std::invalid_argument("the colour has no hue; a white or black target is bright or dark");
}

void check_marker(const TargetLook& look) {
  const auto dictionary = marker_dictionary(look.dictionary);
  if (!dictionary) throw std::invalid_argument("'" + look.dictionary + "' is not a dictionary of markers");
  if (look.marker_id < 0 || look.marker_id >= dictionary->num_markers)
    throw std::invalid_argument(fmt::format("dictionary '{}' has markers 0 to {}, not {}", look.dictionary,
                                            dictionary->num_markers - 1, look.marker_id));
}

cv::Mat checked_pattern(const cv::Mat* pattern) {
  constexpr int min_side_px = 8;
  if (pattern == nullptr || pattern->rows < min_side_px || pattern->cols < min_side_px)
    throw std::invalid_argument("a pattern has 8 pixels a side or more");
  cv::Mat grey;
  one_channel(*pattern).convertTo(grey, CV_32F);
  cv::Scalar mean, sigma;
  cv::meanStdDev(grey, mean, sigma);
  constexpr double min_contrast = 4.0;  // of 255
  if (!(sigma[0] > min_contrast)) throw std::invalid_argument("the pattern is of one grey; it needs contrast");
  return grey;
}

}  // namespace

class TargetDetector::Impl {
 public:
  Impl(const TargetLook& look, const cv::Mat* pattern) : look_(look) {
    if (look.kind == TargetKind::colour) check_colour(look.rgb);
    if (look.kind == TargetKind::marker) check_marker(look);
    if (look.kind == TargetKind::pattern) pattern_ = checked_pattern(pattern);
  }

  TargetDetection find(const cv::Mat& frame, const std::optional<TargetExpectation>& expected) {
    switch (look_.kind) {
      case TargetKind::colour:
        if (frame.type() != CV_8UC3) return lost_target("a grey image has no colours");
        return find_target_blob(frame, look_, expected);
      case TargetKind::bright:
      case TargetKind::dark:
        return find_target_blob(frame, look_, expected);
      case TargetKind::marker:
        return find_target_marker(one_channel(frame), look_, expected);
      case TargetKind::pattern:
        break;
    }
    return find_target_pattern(one_channel(frame), pattern_, look_, expected, scale_);
  }

 private:
  TargetLook look_;
  cv::Mat pattern_;
  double scale_ = 1.0;
};

TargetDetector::TargetDetector(const TargetLook& look, const cv::Mat* pattern)
    : impl_(std::make_unique<Impl>(look, pattern)) {}
TargetDetector::TargetDetector(TargetDetector&&) noexcept = default;
TargetDetector& TargetDetector::operator=(TargetDetector&&) noexcept = default;
TargetDetector::~TargetDetector() = default;

TargetDetection TargetDetector::find(const cv::Mat& frame, const std::optional<TargetExpectation>& expected) {
  return impl_->find(frame, expected);
}

}  // namespace alidade
