#pragma once

#include <string>
#include <string_view>

namespace cv {
class Mat;
}

namespace alidade {

/// Images as files hold them, read and written by the libraries of their formats (libjpeg, libpng, libtiff, libwebp):
/// OpenCV's own reader loads a hundred libraries, and every command would start 50 ms later with them.

/// The pixels as they are stored: 8 or 16 bit, grey or BGR; a rotation requested by the file is not applied.
/// Transparency is dropped, or kept as a fourth channel. Empty where it is no JPEG, PNG, TIFF, WebP, BMP, PGM or PPM,
/// or a broken one.
[[nodiscard]] cv::Mat decode_image(std::string_view bytes, bool keep_alpha = false);

/// A PNG of 8 or 16 bit; grey, BGR or BGRA. Throws std::invalid_argument for another kind of pixels.
[[nodiscard]] std::string png_bytes(const cv::Mat& image);

/// A JPEG of 8 bit, grey or BGR; quality 1 to 100. Throws std::invalid_argument for another kind of pixels.
[[nodiscard]] std::string jpeg_bytes(const cv::Mat& image, int quality);

}  // namespace alidade
