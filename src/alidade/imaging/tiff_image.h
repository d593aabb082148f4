#pragma once

#include <string>
#include <string_view>

namespace cv {
class Mat;
}

namespace alidade {

/// A TIFF's first image as decode_image() returns it: 8 or 16 bit, grey, BGR or BGRA; with any compression that libtiff
/// supports. Empty if it cannot be read.
[[nodiscard]] cv::Mat decode_tiff(std::string_view bytes, bool keep_alpha);

/// The reason, if its numbers are not those of a photo: "a TIFF of 32-bit floating-point numbers: save it with 8 or 16
/// bits". Empty for any other file.
[[nodiscard]] std::string foreign_numbers(std::string_view bytes);

}  // namespace alidade
