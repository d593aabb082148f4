#include "alidade/capture/pose_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/calibrate/pose_information.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double tilt_rad = 0.55;     // 32°: what a person holds easily
constexpr double other_share = 0.08;  // of the board: so far from every photo that is kept
constexpr double edge_share = 0.03;   // of the image's width that an outline keeps from its edge

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix) { return Llt(matrix).inverse(); }

/// The worst pixel counts most; the rest of the image decides between poses that serve it alike.
double score(const SigmaMap::Summary& sigma) { return 0.7 * std::log(sigma.worst_px) + 0.3 * std::log(sigma.rms_px); }

/// The board rotated by `tilt` about its centre, which is seen at `px`; `fill` of the image wide or high.
std::optional<Rigid3> posed(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                            const Eigen::Vector2d& px, double fill, const Eigen::Vector3d& tilt) {
  Eigen::AlignedBox3d box;
  for (const auto& point : board_points) box.extend(point);
  const auto ray = unproject(camera, px);
  if (!ray || !(ray->z() > 0.1)) return std::nullopt;
  const Eigen::VectorXd lens = params(camera.lens);
  const double distance_m =
      std::max(lens[0] * box.sizes().x() / camera.width_px, lens[1] * box.sizes().y() / camera.height_px) / fill;
  const Eigen::Quaterniond rotation = exp_so3(tilt);
  return Rigid3{rotation, *ray * (distance_m / ray->z()) - rotation * box.center()};
}

}  // namespace

bool is_same_pose(const BoardView& a, const BoardView& b, double share) {
  constexpr std::size_t enough = 8;  // corners, spread over the board
  Eigen::AlignedBox2d box;
  for (const Corner& corner : a.corners) box.extend(corner.px);
  const double near_px = share * box.diagonal().norm();
  const std::size_t step = std::max<std::size_t>(1, a.corners.size() / enough);
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < a.corners.size(); i += step) {
    const auto same = std::ranges::lower_bound(b.corners, a.corners[i].index, {}, &Corner::index);
    if (same == b.corners.end() || same->index != a.corners[i].index) continue;
    sum += (same->px - a.corners[i].px).norm();
    ++count;
    if (sum > near_px * static_cast<double>(enough + 1)) return false;
  }
  return count >= 4 && sum < near_px * count;
}

PosePlan::PosePlan(const Camera& camera, std::vector<Eigen::Vector3d> board_points, double noise_px)
    : camera_(camera),
      board_points_(std::move(board_points)),
      noise_px_(noise_px),
      free_(free_parameters(camera)),
      map_(camera, free_, 9, 7) {
  const Eigen::MatrixXd cov = submatrix(camera.cov, free_);
  scale_ = cov.diagonal().cwiseSqrt();
  information_ = inverse_of(scale_.cwiseInverse().asDiagonal() * cov * scale_.cwiseInverse().asDiagonal());
  now_ = map_.of(cov);
}

Eigen::MatrixXd PosePlan::scaled(const Eigen::MatrixXd& information) const {
  return scale_.asDiagonal() * information * scale_.asDiagonal() / (noise_px_ * noise_px_);
}

SigmaMap::Summary PosePlan::with(const Eigen::MatrixXd& information) const {
  return map_.of(scale_.asDiagonal() * inverse_of(information) * scale_.asDiagonal());
}

double PosePlan::gain_of(const BoardView& view, const Rigid3& cam_from_board) const {
  const auto information = lens_information(camera_, board_points_, view, cam_from_board, free_);
  if (!information || free_.empty()) return 0.0;
  const double gain = score(now_) - score(with(information_ + scaled(*information)));
  return std::isfinite(gain) ? std::max(0.0, gain) : 0.0;
}

/// Drawn towards the centre until all of the board is seen.
void PosePlan::add_candidate(const Eigen::Vector2d& wanted_px, double fill, const Eigen::Vector3d& tilt, int cell,
                             const std::vector<BoardView>& kept) {
  const Eigen::Vector2d centre_px(0.5 * (camera_.width_px - 1), 0.5 * (camera_.height_px - 1));
  const double margin_px = edge_share * camera_.width_px;
  for (double reach = 1.0; reach > 0.2; reach -= 0.1) {
    const auto pose = posed(camera_, board_points_, centre_px + reach * (wanted_px - centre_px), fill, tilt);
    const auto view = pose ? predicted_view(camera_, board_points_, *pose, margin_px) : std::nullopt;
    if (!view) continue;
    if (std::ranges::any_of(kept, [&](const BoardView& one) { return is_same_pose(*view, one, other_share); })) return;
    const auto information = lens_information(camera_, board_points_, *view, *pose, free_);
    if (!information) return;
    Candidate candidate{*pose, scaled(*information), 0.0, cell};
    candidate.gain = score(now_) - score(with(information_ + candidate.information));
    if (std::isfinite(candidate.gain)) candidates_.push_back(std::move(candidate));
    return;
  }
}

void PosePlan::look_for_best(const std::vector<BoardView>& kept) {
  candidates_.clear();
  if (free_.empty()) return;
  const std::array<Eigen::Vector3d, 5> tilts{
      Eigen::Vector3d{0, 0, 0}, {tilt_rad, 0, 0}, {-tilt_rad, 0, 0}, {0, tilt_rad, 0}, {0, -tilt_rad, 0}};
  for (const double fill : {0.4, 0.6, 0.8}) {
    for (int cell = 0; cell < 25; ++cell) {
      const Eigen::Vector2d px((0.04 + 0.23 * (cell % 5)) * camera_.width_px,
                               (0.04 + 0.23 * (cell / 5)) * camera_.height_px);
      for (const Eigen::Vector3d& tilt : tilts) add_candidate(px, fill, tilt, cell, kept);
    }
  }
  const auto best = std::ranges::max_element(candidates_, {}, &Candidate::gain);
  if (best == candidates_.end()) return;
  best_ = best->cam_from_board;
  best_gain_ = best->gain;
}

std::optional<int> PosePlan::photos_until(double goal_3sigma_px, double share) const {
  if (worst_3sigma_px() <= goal_3sigma_px) return 0;
  std::vector<const Candidate*> chosen(25,
                                       nullptr);  // the best of each position: enough to choose from again and again
  for (const Candidate& candidate : candidates_) {
    const Candidate*& of_cell = chosen[static_cast<std::size_t>(candidate.cell)];
    if (!of_cell || candidate.gain > of_cell->gain) of_cell = &candidate;
  }
  std::erase(chosen, nullptr);
  if (chosen.empty()) return std::nullopt;
  constexpr int max_steps = 12, most = 999;
  Eigen::MatrixXd information = information_;
  double worst_px = 3.0 * now_.worst_px;
  for (int photo = 1; photo <= max_steps; ++photo) {
    SigmaMap::Summary best;
    best.worst_px = best.rms_px = 1e300;
    const Candidate* next = nullptr;
    for (const Candidate* candidate : chosen) {
      const SigmaMap::Summary sigma = with(information + candidate->information);
      if (!std::isfinite(sigma.worst_px) || score(sigma) >= score(best)) continue;
      best = sigma;
      next = candidate;
    }
    if (!next) return std::nullopt;
    information += share * next->information;
    worst_px = 3.0 * with(information).worst_px;
    if (worst_px <= goal_3sigma_px) return photo;
  }
  // From here on every photo brings about as much as the ones before: σ falls with the root of their number.
  const double gained = 9.0 / (worst_px * worst_px) - 1.0 / (now_.worst_px * now_.worst_px);
  const double lacking = 9.0 / (goal_3sigma_px * goal_3sigma_px) - 9.0 / (worst_px * worst_px);
  if (!(gained > 0.0)) return most;
  return static_cast<int>(std::min<double>(most, max_steps + std::ceil(lacking / (gained / max_steps))));
}

}  // namespace alidade
