#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/counts.h"

namespace alidade {

/// A row of a table of shots: what it says itself, and the photos that tell the rest.
struct ShotRow {
  Shot shot;              ///< shot.name: the photo, else "row 17".
  std::string photo;      ///< As written; empty: none. Of the board, the laser on.
  std::string photo_off;  ///< The same without the laser; empty: none.
  std::size_t line = 0;
};

struct ShotsFile {
  std::vector<ShotRow> rows;
  std::vector<SkippedInput> skipped;
};

struct ShotsOptions {
  bool skip_bad = false;  ///< Leave out rows that are wrong, by name.
};

/// Reads `range_m` with any of `u,v` (also `u_px,v_px`), `photo`, `photo_off`, `nx,ny,nz,d` (also `d_m`), and optional
/// `sigma_px`, `sigma_range_m`. Empty cells are not there. A plane may be written with either sign of all four.
/// Throws InputError: no such column, a range that is not above zero or beyond 1 km (not metres), half a spot, a normal
/// that is not a unit vector, a plane through the camera's centre, a row that says nothing but its range, no rows.
[[nodiscard]] ShotsFile read_shots(const std::filesystem::path& file, const ShotsOptions& options = {});

/// Such a table of shots with spots and planes; photos are named where shot.name is one (`with_photos`).
[[nodiscard]] std::string shots_csv(std::span<const Shot> shots, bool with_photos);

}  // namespace alidade
