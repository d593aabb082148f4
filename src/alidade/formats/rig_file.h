#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Text of rig.yaml: heads with their cameras (`camera_files`, one per head, as written; none: inline), mounting,
/// encoders, and the covariance where it is known.
[[nodiscard]] std::string rig_text(const Rig& rig, std::span<const std::string> camera_files = {});

/// Reads it. A camera's file name is relative to the rig's file; what is not there is zero or identity. Throws
/// InputError: a key that is unknown, missing or no number, a quaternion that is no rotation, an encoder's angle that
/// looks like degrees, two heads of one id, something that is no covariance. A head's `intrinsics` is read along. A
/// camera file that is not what the rig was calibrated with (`camera_values` of a head, where it is there) is in its
/// doubts: "rig.yaml: camera_1.yaml has fx 905.1, but the rig was calibrated with 900.6".
[[nodiscard]] Rig read_rig(const std::filesystem::path& file);

/// The camera files that it names, in the order of its heads; of what read_rig() refuses perhaps none.
[[nodiscard]] std::vector<std::filesystem::path> camera_files_of_rig(const std::filesystem::path& file);

/// Reads the camera of each head of a table: one file for all, or one for each head in the order of `ids`. Throws
/// InputError: another number of files (`table` is named), a camera that cannot be read or is not central.
[[nodiscard]] std::map<int, Camera> read_cameras_by_head(const std::vector<std::filesystem::path>& files,
                                                         const std::vector<int>& ids,
                                                         const std::filesystem::path& table);

ALIDADE_PUBLIC_END
}  // namespace alidade
