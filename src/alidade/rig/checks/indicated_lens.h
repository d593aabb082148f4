#pragma once

#include <map>
#include <optional>

#include "alidade/rig/report.h"

namespace alidade {

/// Whether the most significant cause is of a lens.
[[nodiscard]] bool indicates_lens(const RigReport& report);

/// The cameras with the lens, or lenses, that this cause indicates: its size added to the values of their files. None
/// if the cause is not of a lens, or the model lacks that parameter.
[[nodiscard]] std::optional<std::map<int, Camera>> with_indicated_lens(const std::map<int, Camera>& cameras,
                                                                       const RigReport& report);

}  // namespace alidade
