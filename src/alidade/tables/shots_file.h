#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/counts.h"
#include "alidade/public.h"

namespace alidade {
class Csv;
struct BoardView;

ALIDADE_PUBLIC_BEGIN

struct ShotsFile {
  std::vector<Shot> shots;  ///< shot.name is the photo's name, or else "row 17".
  std::vector<SkippedInput> skipped;
};

struct ShotsOptions {
  bool skip_bad = false;  ///< Wrong rows are rejected and listed.
};

/// Reads `range_m` with any of `u,v` (also `u_px,v_px`), `photo`, `photo_off`, `nx,ny,nz,d` (also `d_m`), and optional
/// `sigma_px`, `sigma_range_m`. Empty cells count as absent. The sign of a plane (nx,ny,nz,d) is arbitrary. Throws
/// InputError for a missing column, a range that is not positive or beyond 1 km (not metres), an incomplete spot, a
/// normal that is not a unit vector, a plane through the camera's centre, a row with nothing but a range, or no rows.
[[nodiscard]] ShotsFile read_shots(const std::filesystem::path& file, const ShotsOptions& options = {});
/// The same for a table that has already been read.
[[nodiscard]] ShotsFile read_shots(const Csv& csv, const ShotsOptions& options = {});

/// The roles of the photos of shots that are not "photo", by name: "photo_off".
[[nodiscard]] std::map<std::string, std::string> photo_roles(std::span<const Shot> shots);

/// Assigns each view of a table of corners (`corners` is its name) to the shots that name its photo. A shot whose photo
/// has no view states so. Views of photos that no shot names are returned as rejected; throws InputError if that is so
/// for all views, or if there are none.
[[nodiscard]] std::vector<SkippedInput> add_corners(const std::filesystem::path& corners,
                                                    std::span<const BoardView> views, std::vector<Shot>& shots);

/// Throws InputError about the first of these shots, whose photo could not be used; `reason` says why. The message
/// mentions a table of corners next to the table of shots, if there is one.
[[noreturn]] void refuse_photo_of(const Shot& shot, const std::string& reason);

/// Text of a table of shots with spots and planes; with `with_photos`, photos are named where shot.name is a photo.
[[nodiscard]] std::string shots_csv(std::span<const Shot> shots, bool with_photos);

ALIDADE_PUBLIC_END
}  // namespace alidade
