#pragma once

#include "alidade/localize/localization.h"

namespace alidade {

/// What the path takes as given: the camera, and the target's scale.
[[nodiscard]] std::vector<Assumption> localize_assumed(const Localization& result);

/// Whether the path stands. A path that its observations contradict is never good.
[[nodiscard]] Verdict localize_verdict(const Localization& result);

}  // namespace alidade
