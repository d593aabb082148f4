#include "alidade/localize/path/similarity_graph.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/so3.h"
#include "alidade/localize/camera_motion.h"

namespace alidade {
namespace {

constexpr int dim = 7;  // of a keyframe: position in the world, right rotation, log of the scale
using Vector7 = Eigen::Vector<double, dim>;
using Matrix7 = Eigen::Matrix<double, dim, dim>;

/// Error of an edge over its σ, and its derivatives with respect to both keyframes.
struct EdgeError {
  Vector7 error;
  Matrix7 J_from, J_to;
};

EdgeError error_of(const SimilarityEdge& edge, const Similarity& from, const Similarity& to) {
  const Eigen::Matrix3d R_from = from.b_from_a.rotation.toRotationMatrix();
  const Eigen::Vector3d away = R_from.transpose() * (to.b_from_a.translation - from.b_from_a.translation) / from.scale;
  const Eigen::Quaterniond turned = from.b_from_a.rotation.conjugate() * to.b_from_a.rotation;
  const Eigen::Vector3d phi = log_so3(edge.from_from_to.b_from_a.rotation.conjugate() * turned);
  const Eigen::Matrix3d to_log = right_jacobian(phi).inverse();
  EdgeError out{Vector7::Zero(), Matrix7::Zero(), Matrix7::Zero()};
  out.error << away - edge.from_from_to.b_from_a.translation, phi,
      std::log(to.scale / from.scale / edge.from_from_to.scale);
  out.J_to.topLeftCorner<3, 3>() = R_from.transpose() / from.scale;
  out.J_from.topLeftCorner<3, 3>() = -out.J_to.topLeftCorner<3, 3>();
  out.J_from.block<3, 3>(0, 3) = cross_matrix(away);
  out.J_from.block<3, 1>(0, 6) = -away;
  out.J_to.block<3, 3>(3, 3) = to_log;
  out.J_from.block<3, 3>(3, 3) = -to_log * turned.toRotationMatrix().transpose();
  out.J_to(6, 6) = 1.0;
  out.J_from(6, 6) = -1.0;
  Vector7 weight;
  weight << Eigen::Vector3d::Constant(1.0 / edge.sigma_length), Eigen::Vector3d::Constant(1.0 / edge.sigma_rad),
      1.0 / edge.sigma_log_scale;
  out.error = weight.cwiseProduct(out.error);
  out.J_from = weight.asDiagonal() * out.J_from;
  out.J_to = weight.asDiagonal() * out.J_to;
  return out;
}

/// Normal equations of all keyframes except the first.
class GraphStep {
 public:
  explicit GraphStep(std::size_t num_keyframes)
      : H_(dim * static_cast<int>(num_keyframes - 1), dim * static_cast<int>(num_keyframes - 1)),
        g_(Eigen::VectorXd::Zero(H_.rows())) {}

  void add(const SimilarityEdge& edge, const EdgeError& at, double weight) {
    add_block(edge.from, edge.from, weight * at.J_from.transpose() * at.J_from);
    add_block(edge.to, edge.to, weight * at.J_to.transpose() * at.J_to);
    add_block(edge.from, edge.to, weight * at.J_from.transpose() * at.J_to);
    add_block(edge.to, edge.from, weight * at.J_to.transpose() * at.J_from);
    if (edge.from > 0) g_.segment<dim>(at_of(edge.from)) -= weight * at.J_from.transpose() * at.error;
    if (edge.to > 0) g_.segment<dim>(at_of(edge.to)) -= weight * at.J_to.transpose() * at.error;
  }

  [[nodiscard]] std::optional<Eigen::VectorXd> solved() {
    H_.setFromTriplets(entries_.begin(), entries_.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(H_);
    if (ldlt.info() != Eigen::Success) return std::nullopt;
    const Eigen::VectorXd step = ldlt.solve(g_);
    return step.allFinite() ? std::optional(step) : std::nullopt;
  }

 private:
  [[nodiscard]] static int at_of(std::size_t keyframe) { return dim * (static_cast<int>(keyframe) - 1); }
  void add_block(std::size_t row, std::size_t column, const Matrix7& block) {
    if (row == 0 || column == 0) return;
    for (int i = 0; i < dim; ++i)
      for (int j = 0; j < dim; ++j) entries_.emplace_back(at_of(row) + i, at_of(column) + j, block(i, j));
  }

  Eigen::SparseMatrix<double> H_;
  Eigen::VectorXd g_;
  std::vector<Eigen::Triplet<double>> entries_;
};

Similarity moved_by(const Similarity& keyframe, const Eigen::Ref<const Vector7>& step) {
  Similarity moved = keyframe;
  moved.b_from_a.translation += step.head<3>();
  moved.b_from_a.rotation = (keyframe.b_from_a.rotation * exp_so3(step.segment<3>(3))).normalized();
  moved.scale *= std::exp(std::clamp(step[6], -1.0, 1.0));
  return moved;
}

}  // namespace

Similarity inverse(const Similarity& b_from_a) {
  Similarity a_from_b{b_from_a.b_from_a.inverse(), 1.0 / b_from_a.scale};
  a_from_b.b_from_a.translation /= b_from_a.scale;
  return a_from_b;
}

Eigen::Vector3d operator*(const Similarity& similarity, const Eigen::Vector3d& point_in_a) {
  return similarity.b_from_a * Eigen::Vector3d(similarity.scale * point_in_a);
}

Similarity operator*(const Similarity& second, const Similarity& first) {
  const Rigid3 &c_from_b = second.b_from_a, &b_from_a = first.b_from_a;
  return {{(c_from_b.rotation * b_from_a.rotation).normalized(), second * b_from_a.translation},
          second.scale * first.scale};
}

std::optional<SimilarityGraph> settled_graph(std::vector<Similarity> world_from_keyframe,
                                             std::span<const SimilarityEdge> edges) {
  constexpr double fits = 30.0, relaxed = 1.6, settled = 1e-6;  // χ² with seven degrees of freedom: 99.99 %
  constexpr int max_steps = 80;
  SimilarityGraph graph{std::move(world_from_keyframe), std::vector<bool>(edges.size(), true)};
  if (graph.world_from_keyframe.size() < 2) return graph;
  double wide = 0.0;  // scale of the loop weights in units of `fits`; 0: not set
  for (int k = 0; k < max_steps; ++k) {
    GraphStep step(graph.world_from_keyframe.size());
    double worst = 0.0;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const EdgeError at =
          error_of(edges[i], graph.world_from_keyframe[edges[i].from], graph.world_from_keyframe[edges[i].to]);
      const double chi2 = at.error.squaredNorm();
      if (edges[i].is_loop) worst = std::max(worst, chi2 / fits);
      const double share = wide > 0.0 ? wide * fits / (wide * fits + chi2) : 1.0;
      const double weight = edges[i].is_loop ? share * share : 1.0;
      graph.holds[i] = !edges[i].is_loop || chi2 < fits;
      step.add(edges[i], at, weight);
    }
    wide = wide > 0.0 ? std::max(1.0, wide / relaxed) : std::max(1.0, 2.0 * worst);
    const auto by = step.solved();
    if (!by) return std::nullopt;
    for (std::size_t i = 1; i < graph.world_from_keyframe.size(); ++i)
      graph.world_from_keyframe[i] =
          moved_by(graph.world_from_keyframe[i], by->segment<dim>(dim * static_cast<Eigen::Index>(i - 1)));
    if (!(wide > 1.0) && by->cwiseAbs().maxCoeff() < settled) return graph;
  }
  return graph;
}

}  // namespace alidade
