#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/estimation/counts.h"
#include "alidade/files/files.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Corners as CSV: photo,corner,u_px,v_px,sigma_u_px,sigma_v_px,corr_uv. Pixels are written to 10⁻⁹ px, so that a file
/// read back gives the same camera.
[[nodiscard]] std::string corners_csv(std::span<const BoardView> views);

/// Reads such a file, also from other software: photo, corner, u_px, v_px (or u, v) and, optionally, sigma_u_px,
/// sigma_v_px and corr_uv; without σ the covariance is the identity, meaning "unknown". Photos are in order of first
/// appearance. Throws InputError for a corner that the board does not have, a duplicate corner, a σ that is not
/// positive, or a missing column. If `skipped` is given, a wrong row is rejected and listed there instead.
[[nodiscard]] std::vector<BoardView> read_corners(const std::filesystem::path& file, int num_points,
                                                  std::vector<SkippedInput>* skipped = nullptr);

/// The smallest image size that contains all corners [px], for views whose size is not given.
[[nodiscard]] ImageSize min_size(std::span<const BoardView> views);

/// Poses as CSV: photo,cam_from_board_x_m,…_y_m,…_z_m,…_qw,…_qx,…_qy,…_qz.
[[nodiscard]] std::string poses_csv(const std::vector<std::string>& photos, std::span<const Rigid3> cam_from_board);

/// Writes and reads board points as CSV: corner,x_m,y_m,z_m. Throws InputError if a point is missing.
[[nodiscard]] std::string board_points_csv(std::span<const Eigen::Vector3d> points_in_board);
[[nodiscard]] std::vector<Eigen::Vector3d> read_board_points(const std::filesystem::path& file, int num_points);

ALIDADE_PUBLIC_END
}  // namespace alidade
