#include "alidade/observe/solve/bundle_normal.h"

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double unbound = 1e-9;  // a point without observations stays fixed

Eigen::Matrix3d inverse_of_frame(const NormalBlock& frame, double damping) {
  Eigen::Matrix3d information = frame.information;
  information.diagonal() *= 1.0 + damping;
  return information.inverse();
}

/// The system reduced by one kind of block: shared parameters, then three rows per block of the other kind.
struct Reduced {
  Eigen::MatrixXd information;  ///< Lower triangle only.
  Eigen::VectorXd gradient;
};

Reduced with_blocks(const BundleNormal& normal, const std::vector<NormalBlock>& kept, double damping) {
  const Eigen::Index n = normal.common.rows();
  const auto size = n + 3 * std::ssize(kept);
  Reduced reduced{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd(size)};
  reduced.information.topLeftCorner(n, n) = normal.common;
  reduced.gradient.head(n) = normal.gradient;
  for (Eigen::Index i = 0; i < std::ssize(kept); ++i) {
    const NormalBlock& block = kept[static_cast<std::size_t>(i)];
    reduced.information.block<3, 3>(n + 3 * i, n + 3 * i) = block.information;
    reduced.information.block(n + 3 * i, 0, 3, n) = block.by_common;
    reduced.gradient.segment<3>(n + 3 * i) = block.gradient;
  }
  reduced.information.diagonal() *= 1.0 + damping;
  return reduced;
}

/// Contribution of one block: S −= Bᵀ P⁻¹ B over the shared parameters and the kept blocks that it crosses.
class Elimination {
 public:
  Elimination(const NormalBlock& block, const Eigen::Matrix3d& inverse, Eigen::Index n, Reduced& reduced)
      : block_(block), inverse_(inverse), n_(n), reduced_(reduced) {
    const ByCommon gain = inverse * block.by_common;
    reduced.information.topLeftCorner(n, n).noalias() -= block.by_common.transpose() * gain;
    reduced.gradient.head(n).noalias() -= gain.transpose() * block.gradient;
  }

  /// With a kept block: `across` is eliminated × kept.
  void cross(Eigen::Index kept, const Eigen::Matrix3d& across) {
    const Eigen::Index at = n_ + 3 * kept;
    const Eigen::Matrix3d gain = across.transpose() * inverse_;
    reduced_.information.block(at, 0, 3, n_).noalias() -= gain * block_.by_common;
    reduced_.gradient.segment<3>(at).noalias() -= gain * block_.gradient;
    crossed_.push_back({at, across});
    for (const auto& [other, information] : crossed_) {
      if (other <= at)
        reduced_.information.block<3, 3>(at, other).noalias() -= gain * information;
      else
        reduced_.information.block<3, 3>(other, at).noalias() -= (gain * information).transpose();
    }
  }

 private:
  const NormalBlock& block_;
  const Eigen::Matrix3d& inverse_;
  Eigen::Index n_;
  Reduced& reduced_;
  std::vector<std::pair<Eigen::Index, Eigen::Matrix3d>> crossed_;
};

/// The crossings of each point, in the order of frames.
std::vector<std::vector<const PointFrameBlock*>> crossings_by_point(const BundleNormal& normal) {
  std::vector<std::vector<const PointFrameBlock*>> by_point(normal.points.size());
  for (const PointFrameBlock& crossing : normal.crossings)
    by_point[static_cast<std::size_t>(crossing.point)].push_back(&crossing);
  return by_point;
}

/// Couples each rotation of a random walk with the one before.
void add_walk(const BundleNormal& normal, Reduced& reduced) {
  const Eigen::Index n = normal.common.rows();
  for (Eigen::Index k = 1; k < std::ssize(normal.walk); ++k)
    reduced.information.block<3, 3>(n + 3 * k, n + 3 * (k - 1)).diagonal().array() -=
        normal.walk[static_cast<std::size_t>(k)];
}

Reduced without_points(const BundleNormal& normal, double damping) {
  const Eigen::Index n = normal.common.rows();
  Reduced reduced = with_blocks(normal, normal.frames, damping);
  add_walk(normal, reduced);
  const auto by_point = crossings_by_point(normal);
  for (std::size_t i = 0; i < normal.points.size(); ++i) {
    const Eigen::Matrix3d inverse = inverse_of_point(normal.points[i], damping);
    Elimination elimination(normal.points[i], inverse, n, reduced);
    for (const PointFrameBlock* crossing : by_point[i]) elimination.cross(crossing->frame, crossing->information);
  }
  return reduced;
}

Reduced without_frames(const BundleNormal& normal, double damping) {
  const Eigen::Index n = normal.common.rows();
  Reduced reduced = with_blocks(normal, normal.points, damping);
  reduced.information.diagonal().tail(3 * std::ssize(normal.points)).array() += unbound;
  std::size_t next = 0;
  for (std::size_t k = 0; k < normal.frames.size(); ++k) {
    const Eigen::Matrix3d inverse = inverse_of_frame(normal.frames[k], damping);
    Elimination elimination(normal.frames[k], inverse, n, reduced);
    for (; next < normal.crossings.size() && normal.crossings[next].frame == static_cast<int>(k); ++next)
      elimination.cross(normal.crossings[next].point, normal.crossings[next].information.transpose());
  }
  return reduced;
}

bool eliminates_frames(const BundleNormal& normal) {
  return normal.frames_are_measured && normal.frames.size() > normal.points.size();
}

/// Back-substitution. Input `gone`: the eliminated blocks' equations after the shared parameters are inserted, 3 × any.
template <typename Matrix>
void follow_kept(const BundleNormal& normal, double damping, const std::vector<Matrix>& kept,
                 std::vector<Matrix>& gone) {
  const bool frames_go = eliminates_frames(normal);
  for (const auto& [point, frame, information] : normal.crossings) {
    const auto p = static_cast<std::size_t>(point), f = static_cast<std::size_t>(frame);
    if (frames_go)
      gone[f] += information.transpose() * kept[p];
    else
      gone[p] += information * kept[f];
  }
  for (std::size_t i = 0; i < gone.size(); ++i)
    gone[i] =
        (-(frames_go ? inverse_of_frame(normal.frames[i], damping) : inverse_of_point(normal.points[i], damping)) *
         gone[i])
            .eval();
}

std::vector<Eigen::Vector3d> in_threes(const Eigen::VectorXd& step, Eigen::Index from) {
  std::vector<Eigen::Vector3d> each;
  for (Eigen::Index at = from; at < step.size(); at += 3) each.emplace_back(step.segment<3>(at));
  return each;
}

}  // namespace

Eigen::Matrix3d inverse_of_point(const NormalBlock& point, double damping) {
  Eigen::Matrix3d information = point.information;
  information.diagonal() *= 1.0 + damping;
  information.diagonal().array() += unbound;
  return information.inverse();
}

BundleStep bundle_step(const BundleNormal& normal, double damping) {
  const Eigen::Index n = normal.common.rows();
  const bool frames_go = eliminates_frames(normal);
  const Reduced reduced = frames_go ? without_frames(normal, damping) : without_points(normal, damping);
  const Eigen::VectorXd step = -solve_symmetric(reduced.information, reduced.gradient);
  BundleStep result{step.head(n), {}, {}};
  std::vector<Eigen::Vector3d>& kept = frames_go ? result.points : result.frames;
  std::vector<Eigen::Vector3d>& gone = frames_go ? result.frames : result.points;
  kept = in_threes(step, n);
  for (const NormalBlock& block : frames_go ? normal.frames : normal.points)
    gone.emplace_back(block.gradient + block.by_common * result.common);
  follow_kept(normal, damping, kept, gone);
  return result;
}

BundleSlopes slopes_by_common(const BundleNormal& normal) {
  const Eigen::Index n = normal.common.rows();
  const bool frames_go = eliminates_frames(normal);
  const Reduced reduced = frames_go ? without_frames(normal, 0.0) : without_points(normal, 0.0);
  BundleSlopes slopes;
  std::vector<ByCommon>& kept = frames_go ? slopes.points : slopes.frames;
  std::vector<ByCommon>& gone = frames_go ? slopes.frames : slopes.points;
  const Eigen::Index size = reduced.information.rows() - n;
  if (size > 0) {
    const Eigen::MatrixXd follow = -Ldlt(reduced.information.bottomRightCorner(size, size))
                                        .solve_each(reduced.information.bottomLeftCorner(size, n));
    for (Eigen::Index at = 0; at < size; at += 3) kept.emplace_back(follow.middleRows<3>(at));
  }
  for (const NormalBlock& block : frames_go ? normal.frames : normal.points) gone.push_back(block.by_common);
  follow_kept(normal, 0.0, kept, gone);
  return slopes;
}

CommonMatrix common_information(const BundleNormal& normal, const CommonMatrix& prior) {
  const Eigen::Index n = normal.common.rows();
  Reduced reduced = eliminates_frames(normal) ? without_frames(normal, 0.0) : without_points(normal, 0.0);
  reduced.information.topLeftCorner(n, n) -= prior;
  const Eigen::Index kept = reduced.information.rows() - n;
  if (kept > 0) {
    const Eigen::MatrixXd by_common = reduced.information.bottomLeftCorner(kept, n);
    reduced.information.topLeftCorner(n, n).noalias() -=
        by_common.transpose() * Ldlt(reduced.information.bottomRightCorner(kept, kept)).solve_each(by_common);
  }
  return reduced.information.topLeftCorner(n, n);
}

}  // namespace alidade
