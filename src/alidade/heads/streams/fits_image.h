#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// An image of a FITS file, and what its header says of when it was taken.
struct FitsImage {
  int width_px = 0, height_px = 0;
  std::vector<double> values;  ///< BSCALE · stored + BZERO, row by row as in the file.
  double begin_s = 0.0;        ///< DATE-OBS, seconds since 1970; NaN: not said.
  double exposure_s = 0.0;     ///< EXPTIME; NaN: not said.
};

/// The primary array of a FITS file; of several planes the first. Throws InputError, which begins with `where`: no
/// FITS, or not all of it.
/// Pence et al., "Definition of the Flexible Image Transport System, version 3.0", 2010.
[[nodiscard]] FitsImage read_fits(std::string_view bytes, const std::string& where);

/// 8 bits: from the sky's grey, and a little below it, to what all but a few pixels are darker than.
[[nodiscard]] cv::Mat stretched_to_grey(const FitsImage& image);

}  // namespace alidade
