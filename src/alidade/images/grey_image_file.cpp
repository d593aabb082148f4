#include "alidade/images/grey_image_file.h"

#include <fmt/format.h>

#include <opencv2/core.hpp>

#include "alidade/files/files.h"
#include "alidade/images/photos.h"
#include "alidade/imaging/grey_photo.h"

namespace alidade {

GreyImage read_grey_image(const std::filesystem::path& file, int width_px, int height_px) {
  return grey_image(read_file(file), file.string(), width_px, height_px);
}

GreyImage grey_image(std::string_view bytes, const std::string& file, int width_px, int height_px) {
  std::string reason;
  const cv::Mat grey = to_grey_photo(decode_photo(bytes, file), reason);
  if (grey.empty()) throw InputError(file + ": " + reason);
  if (grey.cols != width_px || grey.rows != height_px)
    throw InputError(
        fmt::format("{}: is {}x{}, the camera is for {}x{}", file, grey.cols, grey.rows, width_px, height_px));
  GreyImage image{grey.cols, grey.rows, {}};
  for (int row = 0; row < grey.rows; ++row)
    image.values.insert(image.values.end(), grey.ptr<float>(row), grey.ptr<float>(row) + grey.cols);
  return image;
}

}  // namespace alidade
