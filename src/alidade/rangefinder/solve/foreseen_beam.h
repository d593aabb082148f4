#pragma once

#include <optional>
#include <vector>

#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// What is known of a beam and its lens, and what rangefinder() states of the beam with more shots: the lens free with
/// it (Refine::all) or fixed and its covariance carried (Refine::beam), and distortion that the camera file gives
/// without σ held, or estimated too once wants_distortion() says so; of a sheet before the print what the shots leave
/// open. Keeps references to what it is made from.
class ForeseenBeam {
 public:
  explicit ForeseenBeam(const BeamNow& now);

  /// The board there; none where the camera does not see it whole, 5 px inside the image.
  [[nodiscard]] std::optional<BoardView> board_at(const Rigid3& cam_from_board) const;

  /// Of a shot measured exactly as predicted, of what the given shots show; none where the lens does not see it.
  [[nodiscard]] std::optional<Eigen::MatrixXd> information_of(double range_m, const Rigid3& cam_from_board,
                                                              const BoardView& board, bool has_spot) const;

  /// Covariance of the beam's free parameters with a shot's information. NaN where it is singular.
  [[nodiscard]] Eigen::MatrixXd cov_with(const Eigen::MatrixXd& added) const;

  /// What follows counts the shot.
  void add(const Eigen::MatrixXd& added);
  [[nodiscard]] BeamBound bound() const;

 private:
  [[nodiscard]] Eigen::MatrixXd known() const;
  [[nodiscard]] Eigen::MatrixXd joint_cov(const Eigen::MatrixXd& information, bool frees_distortion) const;
  [[nodiscard]] BeamMatrix counted_sheet(const Eigen::MatrixXd& information, const Eigen::MatrixXd& cov) const;
  [[nodiscard]] bool wants_free_distortion() const;
  void count_taken_shots();
  void put_sheet();

  const BeamNow& now_;
  Camera camera_;  ///< Of a model that has distortion.
  BeamProblem problem_;
  LensPrior prior_;              ///< Free: what has a σ, then `held_`. Without information: that is in what is known.
  std::vector<int> held_;        ///< Distortion without σ, that may be estimated too.
  Eigen::Index num_ = 0;         ///< Of the beam's and the lens' parameters but `held_`.
  Eigen::MatrixXd information_;  ///< Of the beam, what has a σ, and `held_` and a sheet (these without a prior).
  bool frees_distortion_ = false;
};

}  // namespace alidade
