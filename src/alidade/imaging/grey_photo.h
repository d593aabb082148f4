#pragma once

#include <string>

namespace cv {
class Mat;
}

namespace alidade {

/// Colours as their grey, at the same depth; an image of one channel as it is, sharing its pixels.
[[nodiscard]] cv::Mat one_channel(const cv::Mat& photo);

/// Any image as one channel of 32-bit float, 0 to 255: 8-bit as it is, all others with the brightest pixel at 255,
/// because 10- and 12-bit cameras store their values in 16 bits. Empty, with a reason, where there is no image.
[[nodiscard]] cv::Mat to_grey_photo(const cv::Mat& photo, std::string& reason);

}  // namespace alidade
