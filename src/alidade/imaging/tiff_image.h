#pragma once

#include <string>
#include <string_view>

namespace cv {
class Mat;
}

namespace alidade {

/// A TIFF's first image as decode_image() gives it: 8 or 16 bit, grey, BGR or BGRA; any compression that libtiff
/// knows. Empty where it cannot be read.
[[nodiscard]] cv::Mat decode_tiff(std::string_view bytes, bool keep_alpha);

/// Why not, where its numbers are no photo's: "a TIFF of 32-bit floating-point numbers: save it with 8 or 16 bits".
/// Empty of any other file.
[[nodiscard]] std::string foreign_numbers(std::string_view bytes);

}  // namespace alidade
