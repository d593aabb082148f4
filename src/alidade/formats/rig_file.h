#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "alidade/pantilt/rig.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Text of rig.yaml: heads with their cameras (`camera_files`, one a head, as written; none: inline), mounting,
/// encoders, and the covariance where it is known.
[[nodiscard]] std::string rig_text(const Rig& rig, std::span<const std::string> camera_files = {});

/// Reads it. A camera's file name is relative to the rig's file; what is left out is zero or identity. Throws
/// InputError: a key that is unknown, missing or no number, a quaternion that is no rotation, an encoder's angle that
/// looks like degrees, two heads of one id, something that is no covariance. A head's `intrinsics` is read along.
[[nodiscard]] Rig read_rig(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
