#pragma once

#include <optional>
#include <vector>

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// One run over one log with the errors of its rotation that are estimated; `undone`: what the log is free of already.
[[nodiscard]] ObserveSolution solve_once(const RotationLog& log, const ObserveSetup& config,
                                         const std::vector<RotationError>& errors, const RotationErrors& undone,
                                         const Progress& progress);

/// Gives each frame how the errors rotate it, per ordinary size.
void add_turns(const RotationLog& log, const std::vector<RotationError>& errors, double max_gap_s,
               std::vector<RotationFrame>& frames);

/// How the bundle of a log is adjusted.
[[nodiscard]] AdjustConfig adjust_config_of(const RotationLog& log, const ObserveSetup& config,
                                            const RotatingCamera& start, const PixelScale& scale);

/// Does the bound of the reference allow an answer at all?
[[nodiscard]] bool is_observable(const ObserveSolution& report, const CommonMatrix& bound);

/// fx, fy, cx, cy [px] of the last row until then; none at the end of the log, or where no row has any.
[[nodiscard]] std::optional<Eigen::Vector4d> intrinsics_before(double until_s, const RotationLog& log,
                                                               const std::vector<IntrinsicsEstimate>& rows);

/// Raises the σ of a filter's rows as that of its last row was, from `model` to `stated` (normalised): by the same
/// factor (`inflation`) for errors that pixels share, by the same share of the focal length for what is given with a σ;
/// of rows just before a zoom by the change that came. Returns checks of the changes that the rows followed.
[[nodiscard]] std::vector<Check> state_rows(const RotationLog& log, const CommonMatrix& model,
                                            const CommonMatrix& stated, const Eigen::Array4d& inflation,
                                            const Eigen::Vector4d& last_k, std::vector<IntrinsicsEstimate>& rows);

}  // namespace alidade
