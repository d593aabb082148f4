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
  std::vector<Shot> shots;  ///< shot.name: the photo, else "row 17".
  std::vector<SkippedInput> skipped;
};

struct ShotsOptions {
  bool skip_bad = false;  ///< Reject rows that are wrong, by name.
};

/// Reads `range_m` with any of `u,v` (also `u_px,v_px`), `photo`, `photo_off`, `nx,ny,nz,d` (also `d_m`), and optional
/// `sigma_px`, `sigma_range_m`. Empty cells are not there. A plane may be written with either sign of all four.
/// Throws InputError: no such column, a range that is not above zero or beyond 1 km (not metres), half a spot, a normal
/// that is not a unit vector, a plane through the camera's centre, a row that says nothing but its range, no rows.
[[nodiscard]] ShotsFile read_shots(const std::filesystem::path& file, const ShotsOptions& options = {});
/// The same of a table that was read elsewhere.
[[nodiscard]] ShotsFile read_shots(const Csv& csv, const ShotsOptions& options = {});

/// What the photos of shots are that are no "photo", by name: "photo_off".
[[nodiscard]] std::map<std::string, std::string> photo_roles(std::span<const Shot> shots);

/// Gives each view of a table of corners, `corners` by name, to the shots whose photo it names. A shot whose photo has
/// none says so. Views of photos that no shot names are returned as rejected; throws InputError where that is so of
/// all, or where there are none.
[[nodiscard]] std::vector<SkippedInput> add_corners(const std::filesystem::path& corners,
                                                    std::span<const BoardView> views, std::vector<Shot>& shots);

/// Throws InputError about the first of these shots, whose photo could not be used; `reason`: why. Points to a table of
/// corners beside the shots, where there is one.
[[noreturn]] void refuse_photo_of(const Shot& shot, const std::string& reason);

/// Such a table of shots with spots and planes; photos are named where shot.name is one (`with_photos`).
[[nodiscard]] std::string shots_csv(std::span<const Shot> shots, bool with_photos);

ALIDADE_PUBLIC_END
}  // namespace alidade
