#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace cv {
class Mat;
}

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Returns photo `i`; called from several threads, once per photo. An exception becomes the reason given for it.
using PhotoLoader = std::function<cv::Mat(std::size_t i)>;

/// Returns the photo with that name, as a table gives it; called from several threads. An exception becomes the reason
/// given for the row that names the photo.
using PhotoByName = std::function<cv::Mat(const std::string& name)>;

/// Photos by name, each loaded when needed.
struct Photos {
  std::vector<std::string> names;
  PhotoLoader load;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
