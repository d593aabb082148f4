#include "alidade/calibrate/next_photo.h"

#include <algorithm>
#include <cmath>

#include "alidade/calibrate/pose_information.h"
#include "alidade/camera/projection_sigma.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

struct Candidate {
  Rigid3 cam_from_board;
  Eigen::MatrixXd information;  ///< Of the free lens parameters, per unit noise.
};

std::optional<Candidate> evaluate(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                  const Rigid3& cam_from_board, const std::vector<int>& free) {
  const auto view = predicted_view(camera, board_points, cam_from_board);
  auto information = view ? lens_information(camera, board_points, *view, cam_from_board, free) : std::nullopt;
  if (!information) return std::nullopt;
  return Candidate{cam_from_board, std::move(*information)};
}

/// The board rotated by `tilt` about its centre, its centre seen at `px`, `fill` of the image's width wide.
std::optional<Rigid3> place(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                            const Eigen::Vector2d& px, double fill, const Eigen::Vector3d& tilt) {
  Eigen::AlignedBox3d box;
  for (const auto& point : board_points) box.extend(point);
  const auto ray = unproject(camera, px);
  if (!ray || !(ray->z() > 0.1)) return std::nullopt;
  const double distance_m = params(camera.lens)[0] * box.sizes().x() / (fill * camera.width_px);
  const Eigen::Quaterniond rotation = exp_so3(tilt);
  const Eigen::Vector3d centre_in_cam = *ray * (distance_m / ray->z());
  return Rigid3{rotation, centre_in_cam - rotation * box.center()};
}

std::vector<Candidate> all_candidates(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                      const std::vector<int>& free) {
  constexpr double tilt = 0.55;  // 32°: what a user holds easily
  const std::vector<Eigen::Vector3d> tilts = {{0, 0, 0}, {tilt, 0, 0}, {-tilt, 0, 0}, {0, tilt, 0}, {0, -tilt, 0}};
  std::vector<Candidate> found;
  for (const double fill : {0.3, 0.55}) {
    for (int row = 0; row < 5; ++row) {
      for (int col = 0; col < 5; ++col) {
        const Eigen::Vector2d px((0.1 + 0.2 * col) * camera.width_px, (0.1 + 0.2 * row) * camera.height_px);
        for (const Eigen::Vector3d& turn : tilts) {
          const auto pose = place(camera, board_points, px, fill, turn);
          auto candidate = pose ? evaluate(camera, board_points, *pose, free) : std::nullopt;
          if (candidate) found.push_back(std::move(*candidate));
        }
      }
    }
  }
  return found;
}

double worst_3sigma(Camera camera, const Eigen::MatrixXd& cov, const std::vector<int>& free) {
  camera.cov = full_matrix(cov, free, camera.cov.rows());
  double worst = 0.0;
  const PixelGrid sigma = projection_sigma(camera, 9, 7, std::numeric_limits<double>::infinity());
  for (const double value : sigma.values) {
    if (std::isfinite(value)) worst = std::max(worst, 3.0 * value);
  }
  return worst;
}

}  // namespace

NextPhotoPlan plan_next_photos(const Camera& camera, double noise_px, const std::vector<Eigen::Vector3d>& board_points,
                               int num_photos, const Progress& progress) {
  NextPhotoPlan plan;
  const std::vector<int> free = free_parameters(camera);
  if (free.empty() || !(noise_px > 0.0)) return plan;
  Eigen::MatrixXd cov = submatrix(camera.cov, free);
  plan.worst_3sigma_px = worst_3sigma(camera, cov, free);
  const std::vector<Candidate> candidates = all_candidates(camera, board_points, free);
  if (candidates.empty()) return plan;
  // Scaled to unit diagonal: focal lengths and k3 differ by many orders.
  const Eigen::VectorXd scale = cov.diagonal().cwiseSqrt();
  const auto inverse = [](const Eigen::MatrixXd& S) { return Llt(S).inverse(); };
  const Eigen::MatrixXd correlation = scale.cwiseInverse().asDiagonal() * cov * scale.cwiseInverse().asDiagonal();
  Eigen::MatrixXd information = inverse(correlation);
  std::vector<bool> is_taken(candidates.size());  // two photos of a board that stands still share what the optics do
  for (int photo = 0; photo < num_photos; ++photo) {
    NextPhoto best{{}, std::numeric_limits<double>::infinity()};
    Eigen::MatrixXd best_information;
    std::size_t best_of = candidates.size();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (is_taken[i]) continue;
      report_progress(progress, "trying board poses", i, candidates.size());
      const Eigen::MatrixXd with =
          information + scale.asDiagonal() * candidates[i].information * scale.asDiagonal() / (noise_px * noise_px);
      const Eigen::MatrixXd with_cov = scale.asDiagonal() * inverse(with) * scale.asDiagonal();
      const double worst = worst_3sigma(camera, with_cov, free);
      if (worst >= best.worst_3sigma_px) continue;
      best = {candidates[i].cam_from_board, worst};
      best_information = with;
      best_of = i;
    }
    if (best_of == candidates.size() || !std::isfinite(best.worst_3sigma_px)) break;
    is_taken[best_of] = true;
    plan.photos.push_back(best);
    information = best_information;
  }
  return plan;
}

}  // namespace alidade
