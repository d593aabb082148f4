#pragma once

#include <string>

namespace cv {
class Mat;
}

namespace alidade {

/// Converts colours to grey at the same depth; an image with one channel is returned as it is, sharing its pixels.
[[nodiscard]] cv::Mat one_channel(const cv::Mat& photo);

/// Converts any image to one channel of 32-bit float, 0 to 255: 8-bit images unchanged, all others with the brightest
/// pixel at 255, because 10- and 12-bit cameras store values in 16 bits. Empty, with a reason, for no image.
[[nodiscard]] cv::Mat to_grey_photo(const cv::Mat& photo, std::string& reason);

}  // namespace alidade
