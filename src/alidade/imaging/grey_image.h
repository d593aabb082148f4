#pragma once

#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Grey values, row-major.
struct GreyImage {
  int width_px = 0, height_px = 0;
  std::vector<float> values;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
