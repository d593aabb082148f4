#include "alidade/localize/frames/kept_frames.h"

#include <algorithm>
#include <utility>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

using PoseMatrix = Eigen::Matrix<double, 6, 6>;

/// Whether the filter tracked the camera from one frame to another, without a restart.
bool is_followed(std::span<const PathStep> path, std::size_t from, std::size_t to) {
  for (std::size_t k = from; k <= to; ++k) {
    if (!path[k].has_pose()) return false;
    if (k > from && path[k].event == FrameEvent::restarted) return false;
  }
  return true;
}

/// Interpolates pose and covariance, at `share` of the way from one pose to another.
void put_between(const PathStep& a, const PathStep& b, double share, PathStep& step) {
  Eigen::Vector<double, 6> difference;  // in the first one's camera
  difference.head<3>() =
      a.world_from_cam.rotation.conjugate() * (b.world_from_cam.translation - a.world_from_cam.translation);
  difference.tail<3>() = log_so3(a.world_from_cam.rotation.conjugate() * b.world_from_cam.rotation);
  const Eigen::Vector3d aside = share * difference.head<3>();
  step.world_from_cam.translation = a.world_from_cam.translation + a.world_from_cam.rotation * aside;
  step.world_from_cam.rotation = a.world_from_cam.rotation * exp_so3(share * difference.tail<3>());
  step.cov = (1.0 - share) * a.cov + share * b.cov + share * (1.0 - share) * difference * difference.transpose();
}

}  // namespace

void KeptFrames::add(ObservationFrame frame) {
  if (num_given_++ % stride_ != 0) return;
  frames_.push_back(std::move(frame));
  if (frames_.size() <= max_) return;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < frames_.size(); k += 2) std::swap(frames_[kept++], frames_[k]);
  frames_.resize(kept);
  frames_.shrink_to_fit();
  stride_ *= 2;
}

std::size_t KeptFrames::index_of(std::size_t frame) const {
  return std::min((frame + stride_ - 1) / stride_, frames_.empty() ? 0 : frames_.size() - 1);
}

std::vector<PathStep> KeptFrames::steps(std::span<const PathStep> path) const {
  std::vector<PathStep> kept;
  for (std::size_t k = 0; k < path.size(); k += stride_) kept.push_back(path[k]);
  return kept;
}

KeptFrames KeptFrames::averaged(std::vector<ObservationFrame> means, std::size_t num_each) const {
  KeptFrames still(max_);
  still.stride_ = stride_ * num_each;
  still.num_given_ = num_given_;
  still.frames_ = std::move(means);
  still.is_still_ = true;
  return still;
}

KeptFrames KeptFrames::every(std::size_t num, std::span<const KnownPoint> alone) const {
  std::vector<ObservationFrame> some;
  for (std::size_t k = 0; k < frames_.size(); k += num) {
    some.push_back(frames_[k]);
    if (alone.empty()) continue;
    std::erase_if(some.back().observations, [&](const FeatureObservation& each) {
      return std::ranges::find(alone, each.id, &KnownPoint::id) == alone.end();
    });
  }
  KeptFrames few = averaged(std::move(some), num);
  few.is_still_ = false;
  return few;
}

void KeptFrames::put_back(std::span<const PathStep> solved, std::vector<PathStep>& path) const {
  const std::vector<PathStep> followed = path;
  const auto moved = [&](std::size_t kept, std::size_t to) {  // follows the filter's motion from a kept frame
    PathStep step = solved[kept];
    step.world_from_cam =
        step.world_from_cam * (followed[kept * stride_].world_from_cam.inverse() * followed[to].world_from_cam);
    return step;
  };
  for (std::size_t k = 0; k < path.size(); ++k) {
    const std::size_t a = k / stride_, b = a + 1, at_a = a * stride_, at_b = b * stride_;
    if (k == at_a) {
      path[k] = solved[a];
      continue;
    }
    if (!path[k].has_pose()) continue;
    if (is_still_) {
      const PathStep &before = solved[a], &after = solved[std::min(b, solved.size() - 1)];
      const double share = (path[k].t_s - before.t_s) / std::max(after.t_s - before.t_s, path[k].t_s - before.t_s);
      put_between(before.has_pose() ? before : after, after, share, path[k]);
      continue;
    }
    const bool from_a = is_followed(followed, at_a, k), from_b = at_b < path.size() && is_followed(followed, k, at_b);
    if (from_a && from_b) {
      put_between(moved(a, k), moved(b, k), (path[k].t_s - path[at_a].t_s) / (path[at_b].t_s - path[at_a].t_s),
                  path[k]);
    } else if (from_a || from_b) {
      const PathStep step = moved(from_a ? a : b, k);
      path[k].world_from_cam = step.world_from_cam;
      path[k].cov = step.cov;
    } else {  // lost by the filter in between: only its neighbours determine it
      const PathStep& after = solved[b < solved.size() ? b : a];
      put_between(solved[a].has_pose() ? solved[a] : after, after, 0.5, path[k]);
    }
  }
}

}  // namespace alidade
