#pragma once

#include <optional>
#include <vector>

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// One run over one log, estimating the given errors of its rotation; `undone`: the part already corrected for.
[[nodiscard]] ObserveSolution solve_once(const RotationLog& log, const ObserveSetup& config,
                                         const std::vector<RotationError>& errors, const RotationErrors& undone,
                                         const Progress& progress);

/// Sets in each frame the effect of the errors on its rotation, per typical size.
void add_turns(const RotationLog& log, const std::vector<RotationError>& errors, double max_gap_s,
               std::vector<RotationFrame>& frames);

/// The configuration for adjusting the bundle of a log.
[[nodiscard]] AdjustConfig adjust_config_of(const RotationLog& log, const ObserveSetup& config,
                                            const RotatingCamera& start, const PixelScale& scale);

/// Whether the bound of the reference is small enough for an answer.
[[nodiscard]] bool is_observable(const ObserveSolution& report, const CommonMatrix& bound);

/// fx, fy, cx, cy [px] of the last row until `until_s`; none at the end of the log, or if no row has a value.
[[nodiscard]] std::optional<Eigen::Vector4d> intrinsics_before(double until_s, const RotationLog& log,
                                                               const std::vector<IntrinsicsEstimate>& rows);

/// Raises σ of a filter's rows as that of its last row was raised, from `model` to `stated` (normalised): by the same
/// factor (`inflation`) for errors that pixels share, by the same share of the focal length for given values with a σ;
/// for rows just before a zoom, by the change that followed. Returns checks of the changes that the rows followed.
[[nodiscard]] std::vector<Check> state_rows(const RotationLog& log, const CommonMatrix& model,
                                            const CommonMatrix& stated, const Eigen::Array4d& inflation,
                                            const Eigen::Vector4d& last_k, std::vector<IntrinsicsEstimate>& rows);

}  // namespace alidade
