#pragma once

#include <string>
#include <string_view>

namespace cv {
class Mat;
}

namespace alidade {

/// Images as stored in files, read and written by the libraries of their formats (libjpeg, libpng, libtiff, libwebp):
/// OpenCV's own reader loads a hundred libraries, which would delay the start of every command by 50 ms.

/// The pixels as stored: 8 or 16 bit, grey or BGR; a rotation requested by the file is not applied. Transparency is
/// dropped, or kept as a fourth channel. Empty if the file is not a JPEG, PNG, TIFF, WebP, BMP, PGM or PPM, or is
/// broken.
[[nodiscard]] cv::Mat decode_image(std::string_view bytes, bool keep_alpha = false);

/// A PNG of 8 or 16 bit; grey, BGR or BGRA. Throws std::invalid_argument for other kinds of pixels.
[[nodiscard]] std::string png_bytes(const cv::Mat& image);

/// A JPEG of 8 bit, grey or BGR; quality 1 to 100. Throws std::invalid_argument for other kinds of pixels.
[[nodiscard]] std::string jpeg_bytes(const cv::Mat& image, int quality);

}  // namespace alidade
