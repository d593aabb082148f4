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

/// Text of rig.yaml: heads with their cameras (`camera_files`, one per head, as written; none: inline), mounting and
/// encoders, and the covariance if it is known.
[[nodiscard]] std::string rig_text(const Rig& rig, std::span<const std::string> camera_files = {});

/// Reads rig.yaml. A camera's file name is relative to the rig's file; what is omitted is zero or identity. Throws
/// InputError for an unknown or missing key, a value that is not a number, a quaternion that is not a rotation, an
/// encoder angle that looks like degrees, two heads with one id, or an invalid covariance. A head's `intrinsics` file
/// is read as well. If a camera file differs from what the rig was calibrated with (a head's `camera_values`),
/// Rig::doubts says: "rig.yaml: camera_1.yaml has fx 905.1, but the rig was calibrated with 900.6".
[[nodiscard]] Rig read_rig(const std::filesystem::path& file);

/// The camera files named in a rig's file, in the order of its heads; possibly none if read_rig() refuses the file.
[[nodiscard]] std::vector<std::filesystem::path> camera_files_of_rig(const std::filesystem::path& file);

/// Reads the camera of each head in a table: one file for all, or one per head in the order of `ids`. Throws InputError
/// for another number of files (naming `table`), or a camera that cannot be read or is not central.
[[nodiscard]] std::map<int, Camera> read_cameras_by_head(const std::vector<std::filesystem::path>& files,
                                                         const std::vector<int>& ids,
                                                         const std::filesystem::path& table);

ALIDADE_PUBLIC_END
}  // namespace alidade
