#include "alidade/imaging/grey_photo.h"

#include <opencv2/imgproc.hpp>

namespace alidade {
namespace {

constexpr int min_photo_side_px = 24;  // the smallest board that can be searched

}  // namespace

cv::Mat one_channel(const cv::Mat& photo) {
  if (photo.channels() == 1) return photo;
  cv::Mat grey;
  if (photo.channels() == 3) {
    cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  } else if (photo.channels() == 4) {
    cv::cvtColor(photo, grey, cv::COLOR_BGRA2GRAY);
  } else {
    cv::extractChannel(photo, grey, 0);
  }
  return grey;
}

cv::Mat to_grey_photo(const cv::Mat& photo, std::string& reason) {
  cv::Mat grey;
  if (photo.empty() || photo.dims != 2) {
    reason = "there is no image";
    return grey;
  }
  if (photo.rows < min_photo_side_px || photo.cols < min_photo_side_px) {
    reason = "the image is too small: " + std::to_string(photo.cols) + "×" + std::to_string(photo.rows);
    return grey;
  }
  if (photo.depth() == CV_8U) {
    one_channel(photo).convertTo(grey, CV_32F);
    return grey;
  }
  cv::Mat wide;
  photo.convertTo(wide, CV_MAKETYPE(CV_32F, photo.channels()));  // cvtColor knows 8, 16 bit and float only
  grey = one_channel(wide);
  cv::patchNaNs(grey, 0.0);
  double darkest = 0.0, brightest = 0.0;
  cv::minMaxLoc(grey, &darkest, &brightest);
  if (!(brightest > 0.0) || !(brightest < 1e30)) {
    reason = brightest > 0.0 ? "the image has values without limit" : "the image is black";
    return {};
  }
  grey.convertTo(grey, CV_32F, 255.0 / brightest);
  return grey;
}

}  // namespace alidade
