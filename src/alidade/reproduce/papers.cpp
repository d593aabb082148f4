#include "alidade/reproduce/papers.h"

#include <array>

namespace alidade::reproduce {

std::span<const Paper> papers() {
  static constexpr std::array<Paper, 4> all{{
      {"fang2011", "intrinsics of a rotating camera", reproduce_fang2011},
      {"wang2020", "a laser rangefinder beside a camera", reproduce_wang2020},
      {"xiahou2015", "two pan-tilt cameras that follow a target", reproduce_xiahou2015},
      {"xu-underwater", "localisation under water with three lens models", reproduce_xu_underwater},
  }};
  return all;
}

}  // namespace alidade::reproduce
