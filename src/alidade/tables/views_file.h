#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {

struct ViewsFile {
  std::vector<HeadView> views;  ///< In order of first appearance; seen.photo: "view 17", or the photo's name.
  std::vector<SkippedInput> skipped;
  bool has_photos = false;  ///< `photo` instead of corners: the corners are still to be found.
};

struct ViewsOptions {
  bool skip_bad = false;  ///< Leave out rows that are wrong, by name.
  int num_points = 0;     ///< Of the board.
};

/// Reads `view,board,head,pan_rad,tilt_rad` with `corner,u,v` (also `u_px,v_px`), one row a corner, or with `photo`,
/// one row a view. Throws InputError: a missing column, degrees (more than a turn, or `pan_deg`), a view whose rows
/// differ in board, head or angles, a corner that the board does not have or that stands twice, no rows.
[[nodiscard]] ViewsFile read_views(const std::filesystem::path& file, const ViewsOptions& options);

[[nodiscard]] std::string views_csv(std::span<const HeadView> views);

}  // namespace alidade
