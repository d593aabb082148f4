#include "alidade/localize/filter/given_effects.h"

#include <algorithm>

namespace alidade {

GivenEffects::GivenEffects(const Camera& camera, std::span<const int> estimated, double sigma_scale, int capacity,
                           int observations) {
  const std::vector<std::string> names = param_names(camera.lens);
  const bool has_cov = camera.cov.size() > 0;
  for (int i = 0; i < static_cast<int>(names.size()); ++i) {
    constexpr std::array<std::string_view, 9> tested{"fx",      "fy",    "cx",       "cy",      "k1",
                                                     "n_water", "gap_m", "normal_x", "normal_y"};
    const bool is_tested = std::ranges::find(tested, names[static_cast<std::size_t>(i)]) != tested.end();
    if (!is_tested && !(has_cov && camera.cov(i, i) > 0.0)) continue;
    if (std::ranges::find(estimated, i) == estimated.end()) lens_params_.push_back(i);
  }
  const auto num_lens = static_cast<Eigen::Index>(lens_params_.size()), num = num_lens + 1;
  cov_.setZero(num, num);
  for (Eigen::Index i = 0; has_cov && i < num_lens; ++i)
    for (Eigen::Index j = 0; j < num_lens; ++j)
      cov_(i, j) = camera.cov(lens_params_[static_cast<std::size_t>(i)], lens_params_[static_cast<std::size_t>(j)]);
  cov_(num_lens, num_lens) = sigma_scale * sigma_scale;
  counts_ = !cov_.isZero(0.0);
  information_.setZero(num, num);
  score_.setZero(num);
  constexpr int panel = StateCovariance::panel;
  const auto padded = static_cast<Eigen::Index>((capacity + panel - 1) / panel * panel);
  M_.setZero(padded, num);
  change_.setZero(padded, num);
  G_.setZero(padded, num);
  by_point_.setZero(padded, num);
  of_left_.setZero(num, num);
  rows_.reserve(static_cast<std::size_t>(capacity));
  for (std::vector<double>& each : weights_) each.resize(static_cast<std::size_t>(capacity));
  max_seen_ = static_cast<std::size_t>(observations);
  seen_.reserve(max_seen_);
}

void GivenEffects::predict(const MotionMatrix& F) {
  for (Eigen::Index c = 0; c < M_.cols(); ++c) {
    const Eigen::Vector<double, motion_dim> was = M_.col(c).head<motion_dim>();
    M_.col(c).head<motion_dim>() = F * was;
  }
}

/// A given position is proportional to the scale of the target.
void GivenEffects::add_known(int offset, const Eigen::Vector3d& point_in_world) {
  M_.middleRows<3>(offset).setZero();
  M_.block<3, 1>(offset, M_.cols() - 1) = point_in_world;
}

void GivenEffects::add(int offset, const NewFeature& made, std::span<const int> estimated, const ScaleReading& scale) {
  const int dim = made.feature.dim();
  for (Eigen::Index c = 0; c < M_.cols(); ++c) {
    Eigen::Vector<double, 6> moves = made.J_pose * M_.col(c).head<6>();
    for (std::size_t k = 0; k < estimated.size(); ++k)
      moves += made.J_lens.col(estimated[k]) * M_(motion_dim + static_cast<Eigen::Index>(k), c);
    if (c + 1 < M_.cols()) moves += made.J_lens.col(lens_params_[static_cast<std::size_t>(c)]);
    moves += made.J_range * read(scale.columns(), scale.weights(), c);
    M_.col(c).segment(offset, dim) = moves.head(dim);
  }
}

void GivenEffects::remove(int offset, int count, int dim) {
  for (int i = offset; i < offset + count; ++i)
    for (Eigen::Index a = 0; a < M_.cols(); ++a)
      for (Eigen::Index b = 0; b < M_.cols(); ++b) of_left_(a, b) += by_point_(i, a) * by_point_(i, b);
  for (Columns* numbers : {&M_, &by_point_}) {
    for (Eigen::Index c = 0; c < M_.cols(); ++c) {
      double* const column = numbers->col(c).data();
      std::copy(column + offset + count, column + dim, column + offset);
      std::fill(column + dim - count, column + dim, 0.0);
    }
  }
}

void GivenEffects::make_place(int offset, const Eigen::Matrix<double, 3, 6>& J) {
  for (Eigen::Index c = 0; c < M_.cols(); ++c) {
    const Eigen::Vector<double, 6> was = M_.col(c).segment<6>(offset);
    M_.col(c).segment<3>(offset) = J * was;
  }
}

void GivenEffects::forget_motion() {
  M_.topRows<motion_dim>().setZero();
  score_.setZero();
  information_.setZero();
  by_point_.setZero();
  of_left_.setZero();
}

void GivenEffects::turn(const double* blocks, int stride, int single_at, int num_single, int dim) {
  for (int row = 0; row < dim; row += 3) {
    if (row == single_at) row += num_single;
    if (row >= dim) return;
    Eigen::Matrix3d block;
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) block(i, j) = blocks[j * stride + row + i];
    for (Eigen::Index c = 0; c < M_.cols(); ++c) {
      const Eigen::Vector3d was = M_.col(c).segment<3>(row);
      M_.col(c).segment<3>(row) = block * was;
    }
  }
}

void GivenEffects::shear(int at, const double* K, int stride, int dim) {
  for (Eigen::Index c = 0; c < M_.cols(); ++c) {
    const Eigen::Vector3d by = M_.col(c).segment<3>(at);
    for (int j = 0; j < 3; ++j) M_.col(c).head(dim) += by[j] * Eigen::Map<const Eigen::VectorXd>(K + j * stride, dim);
  }
}

double GivenEffects::read(std::span<const int> columns, std::span<const double> weights, Eigen::Index given) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < columns.size(); ++k) sum += weights[k] * M_(columns[k], given);
  return sum;
}

void GivenEffects::shear_along(std::span<const int> columns, std::span<const double> weights, const double* u,
                               int dim) {
  for (Eigen::Index c = 0; c < M_.cols(); ++c)
    M_.col(c).head(dim) += read(columns, weights, c) * Eigen::Map<const Eigen::VectorXd>(u, dim);
}

GivenEffects::Derivatives GivenEffects::product(const Seen& seen, const Columns& M) const {
  Derivatives D = Derivatives::Zero(2, M.cols());
  for (int k = 0; k < seen.num; ++k)
    for (Eigen::Index c = 0; c < M.cols(); ++c)
      D.col(c) += seen.H.col(k) * M(seen.columns[static_cast<std::size_t>(k)], c);
  return D;
}

void GivenEffects::add_observation(const ExpectedView& view, const Feature& feature, std::span<const int> estimated,
                                   const Eigen::Vector2d& residual_px, double variance_px2) {
  if (seen_.size() == max_seen_) return;
  Seen& seen = seen_.emplace_back();
  const auto put = [&](int column, const Eigen::Vector2d& derivative) {
    seen.columns[static_cast<std::size_t>(seen.num)] = column;
    seen.H.col(seen.num++) = derivative;
  };
  for (int i = 0; i < 6; ++i) put(i, view.J_px_pose.col(i));
  for (std::size_t k = 0; k < estimated.size(); ++k)
    put(motion_dim + static_cast<int>(k), view.J_px_lens.col(estimated[k]));
  for (int i = 0; i < feature.dim(); ++i) put(feature.offset + i, view.J_px_feature.col(i));
  seen.weight = 1.0 / variance_px2;
  seen.D = product(seen, M_);
  for (std::size_t c = 0; c < lens_params_.size(); ++c)
    seen.D.col(static_cast<Eigen::Index>(c)) += view.J_px_lens.col(lens_params_[c]);
  for (Eigen::Index c = 0; c < M_.cols(); ++c) {
    const double score = seen.weight * seen.D.col(c).dot(residual_px);
    score_[c] += score;
    by_point_(feature.offset, c) += score;
  }
}

void GivenEffects::finish(const StateCovariance& P) {
  const int dim = P.dim();
  G_.topRows(dim).setZero();
  for (const Seen& seen : seen_)
    for (int k = 0; k < seen.num; ++k)
      for (Eigen::Index c = 0; c < G_.cols(); ++c)
        G_(seen.columns[static_cast<std::size_t>(k)], c) += seen.weight * seen.H.col(k).dot(seen.D.col(c));
  rows_.clear();
  for (int j = 0; j < dim; ++j)
    if (!G_.row(j).isZero(0.0)) rows_.push_back(j);
  for (Eigen::Index c = 0; c < G_.cols(); c += 2) {  // if the number of columns is odd, the last one is processed twice
    const Eigen::Index next = std::min(c + 1, G_.cols() - 1);
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      weights_[0][k] = -G_(rows_[k], c);
      weights_[1][k] = -G_(rows_[k], next);
    }
    P.product({rows_, weights_[0].data(), weights_[1].data()}, change_.col(c).data(), change_.col(next).data());
  }
  for (const Seen& seen : seen_) {
    const Derivatives after = seen.D + product(seen, change_);
    for (Eigen::Index a = 0; a < G_.cols(); ++a)
      for (Eigen::Index b = 0; b < G_.cols(); ++b) information_(a, b) += seen.weight * seen.D.col(a).dot(after.col(b));
  }
  M_.topRows(dim) += change_.topRows(dim);
  seen_.clear();
}

}  // namespace alidade
