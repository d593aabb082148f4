#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_cameras.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/public.h"

namespace alidade {
class Csv;

ALIDADE_PUBLIC_BEGIN

struct ViewsFile {
  std::vector<HeadView> views;  ///< In order of first appearance; seen.photo is "view 17", or the photo's name.
  std::vector<SkippedInput> skipped;
  bool has_photos = false;  ///< `photo` instead of corners: the corners have yet to be detected.
};

struct ViewsOptions {
  bool skip_bad = false;  ///< Wrong rows are rejected and listed.
  int num_points = 0;     ///< Number of points of the board.
};

/// Reads `view,board,head,pan_rad,tilt_rad` with `corner,u,v` (also `u_px,v_px`), one row per corner, or with `photo`,
/// one row per view. Throws InputError: a missing column, degrees in a column of radians (more than a revolution), a
/// view whose rows differ in board, head or angles, a corner that the board does not have, a duplicate corner, no rows.
[[nodiscard]] ViewsFile read_views(const std::filesystem::path& file, const ViewsOptions& options);
/// The same for a table that has already been read.
[[nodiscard]] ViewsFile read_views(const Csv& csv, const ViewsOptions& options);

/// Throws InputError about the table `file` if a corner lies outside its camera's image.
void require_corners_inside(const std::filesystem::path& file, std::span<const HeadView> views,
                            const std::map<int, Camera>& cameras);

/// Throws InputError about a photo that the table `file` names but that cannot be used.
[[noreturn]] void refuse_photo(const std::filesystem::path& file, const SkippedInput& photo);

[[nodiscard]] std::string views_csv(std::span<const HeadView> views);

ALIDADE_PUBLIC_END
}  // namespace alidade
