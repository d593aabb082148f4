#pragma once

#include <map>
#include <optional>

#include "alidade/rig/report.h"

namespace alidade {

/// The most significant cause is of a lens.
[[nodiscard]] bool indicates_lens(const RigReport& report);

/// The cameras with the lens, or the lenses, that this cause indicates: its size added to what their files say. None:
/// it is of no lens, or of a model without that parameter.
[[nodiscard]] std::optional<std::map<int, Camera>> with_indicated_lens(const std::map<int, Camera>& cameras,
                                                                       const RigReport& report);

}  // namespace alidade
