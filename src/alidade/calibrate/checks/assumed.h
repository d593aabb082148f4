#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/error_modes.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// The assumptions of a calibration: the board's square, and each fixed lens parameter. The shift of the lens by each
/// is the sensitivity of the optimum, dθ/da = −S_θθ⁻¹ S_θa, S the information of both with the poses eliminated; a
/// wrong square does not shift a central lens. `report` must have converged; `scores`: its view_scores().
///
/// `air`: the lens that was given and fixed (flat_port). If it has a covariance C, C is included in
/// `report.camera.cov`: K C Kᵀ for the estimated parameters, K C for the cross-covariance, K = dθ/da.
[[nodiscard]] std::vector<Assumption> count_assumptions(const Board& board, const CalibrateConfig& config,
                                                        std::span<const BoardView> views,
                                                        std::span<const ViewScore> scores,
                                                        const std::optional<Camera>& air, CalibrateReport& report);

/// One row, "lens.not_tested", for what could shift the lens by 5σ unnoticed in these photos; none if there is nothing.
/// It does not affect the verdict.
[[nodiscard]] std::optional<Assumption> not_tested(std::span<const UnseenMode> unseen, const CalibrateReport& report);

/// A parameter of the lens that was given, and what the photos say of it without any of the given ones.
struct GivenValue {
  std::string name;
  double value = 0.0, sigma = 0.0;  ///< σ 0: it is held.
  double by_photos = 0.0, sigma_by_photos = 0.0;

  /// How far apart the two are, in the σ of their difference.
  [[nodiscard]] double apart() const;
};

/// Given values against the photos.
struct GivenValues {
  std::vector<GivenValue> values;  ///< That which is farthest off first.
  bool contradict = false;         ///< Proved.
  bool photos_agree = true;        ///< Without the given values; else something else is wrong, which goes first.
  Eigen::MatrixXd cov;             ///< To be added to the stated one: what of the difference is beyond chance.
};

/// Values given as priors, and a centre or focal length that is held, against a solve without them. None where nothing
/// was given, or where the photos alone do not determine it.
[[nodiscard]] std::optional<GivenValues> test_given_values(const Board& board, std::span<const BoardView> views,
                                                           const CalibrateConfig& config,
                                                           const CalibrateReport& report);

/// Names those that the photos contradict in the verdict, which is of care at best.
void heed_given_values(const GivenValues& given, Verdict& verdict);

}  // namespace alidade
