#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/capture/sigma_map.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// Whether two views show a board held alike: the corners that both have lie apart by less than `share` of the board.
[[nodiscard]] bool is_same_pose(const BoardView& a, const BoardView& b, double share);

/// The information that possible photos would add to a camera with a covariance.
class PosePlan {
 public:
  /// `noise_px`: of a corner, such that photos are worth what they are (shared_noise_px).
  PosePlan(const Camera& camera, std::vector<Eigen::Vector3d> board_points, double noise_px);

  [[nodiscard]] double worst_3sigma_px() const { return 3.0 * now_.worst_px; }
  [[nodiscard]] Eigen::Vector2d worst_px() const { return map_.px(now_.at); }
  /// ln of σ now over σ with that view; 0 where it cannot be determined. 0.01: one percent.
  [[nodiscard]] double gain_of(const BoardView& view, const Rigid3& cam_from_board) const;

  /// Tries poses all over the image: which is the best, and what would it bring. None as in `kept`: their errors would
  /// be the same again.
  void look_for_best(const std::vector<BoardView>& kept);
  [[nodiscard]] const std::optional<Rigid3>& best() const { return best_; }
  [[nodiscard]] double best_gain() const { return best_gain_; }
  /// How many photos are likely needed until 3σ is below the goal at the worst pixel, each with that share of the
  /// information of the best of its time. None where that cannot be determined.
  [[nodiscard]] std::optional<int> photos_until(double goal_3sigma_px, double share) const;

 private:
  struct Candidate {
    Rigid3 cam_from_board;
    Eigen::MatrixXd information;  ///< Scaled.
    double gain = 0.0;
    int cell = 0;
  };
  [[nodiscard]] Eigen::MatrixXd scaled(const Eigen::MatrixXd& information) const;
  [[nodiscard]] SigmaMap::Summary with(const Eigen::MatrixXd& information) const;
  void add_candidate(const Eigen::Vector2d& wanted_px, double fill, const Eigen::Vector3d& tilt, int cell,
                     const std::vector<BoardView>& kept);

  Camera camera_;
  std::vector<Eigen::Vector3d> board_points_;
  double noise_px_;
  std::vector<int> free_;
  SigmaMap map_;
  Eigen::VectorXd scale_;        ///< σ of each free parameter: they differ by many orders.
  Eigen::MatrixXd information_;  ///< Now, scaled.
  SigmaMap::Summary now_;
  std::vector<Candidate> candidates_;
  std::optional<Rigid3> best_;
  double best_gain_ = 0.0;
};

}  // namespace alidade
