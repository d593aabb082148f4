#pragma once

#include <optional>
#include <vector>

#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// Predicts the covariance that rangefinder() would state with more shots. The lens is estimated too (Refine::all), or
/// fixed with its covariance propagated (Refine::beam); distortion without σ in the camera file is fixed, or estimated
/// too once wants_distortion() says so; a sheet in front of the print keeps the uncertainty that the shots leave.
/// Keeps references to its arguments.
class ForeseenBeam {
 public:
  explicit ForeseenBeam(const BeamNow& now);

  /// The board at that pose; none if the camera does not see all of it, 5 px inside the image.
  [[nodiscard]] std::optional<BoardView> board_at(const Rigid3& cam_from_board) const;

  /// Information of a shot like the given ones, measured exactly as predicted; none if the lens does not see it.
  [[nodiscard]] std::optional<Eigen::MatrixXd> information_of(double range_m, const Rigid3& cam_from_board,
                                                              const BoardView& board, bool has_spot) const;

  /// Covariance of the beam's free parameters including a shot's information. NaN if singular.
  [[nodiscard]] Eigen::MatrixXd cov_with(const Eigen::MatrixXd& added) const;

  /// From now on the shot is included.
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
  Camera camera_;  ///< With a model that has distortion.
  BeamProblem problem_;
  LensPrior prior_;              ///< Free: what has a σ, then `held_`. No information: it is in information_.
  std::vector<int> held_;        ///< Distortion without σ that may be estimated too.
  Eigen::Index num_ = 0;         ///< Number of parameters of beam and lens without `held_`.
  Eigen::MatrixXd information_;  ///< Of the beam, what has a σ, `held_` and a sheet (the latter two without prior).
  bool frees_distortion_ = false;
};

}  // namespace alidade
