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

/// Gives photo `i`; called from several threads, each photo once. What it throws becomes that photo's reason.
using PhotoLoader = std::function<cv::Mat(std::size_t i)>;

/// Gives the photo of that name, as a table has it; called from several threads. What it throws becomes the reason of
/// the row that names it.
using PhotoByName = std::function<cv::Mat(const std::string& name)>;

/// Photos by name, each loaded when it is needed.
struct Photos {
  std::vector<std::string> names;
  PhotoLoader load;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
