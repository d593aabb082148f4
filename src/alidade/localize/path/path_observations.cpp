#include <algorithm>
#include <cmath>

#include "alidade/localize/checks/residual_structure.h"
#include "alidade/localize/path/path_system.h"

// Factors of the observations, the main part of a path's cost, and the correlation between errors of the same point in
// successive frames.

namespace alidade {

/// Derivatives of the predicted pixel with respect to the shared parameters: the lens, then the causes (scale and shape
/// only through the known positions).
PathSmoother::GivenRows PathSmoother::given_rows(const ExpectedView& view, std::size_t i, const Twist& twist) const {
  const UsedObservation& observation = observations_[i];
  const auto num_lens = view.J_px_lens.cols();
  GivenRows J = GivenRows::Zero(2, num_lens + num_causes);
  for (Eigen::Index k = 0; k < num_lens; ++k) J.col(k) = view.J_px_lens.col(lens_order_[static_cast<std::size_t>(k)]);
  if (const auto& given = problem_.points[point_of_[i]].given_in_world) {
    // A target that moves, or rotates about its centre: displaced from its given position in proportion to time.
    const Eigen::Matrix<double, 2, 3> J_speed =
        (problem_.t_s[observation.frame] - mid_s_) * view.J_px_feature.leftCols<3>();
    J.middleCols<3>(num_lens + speed_cause) = J_speed;
    J.middleCols<3>(num_lens + turn_cause) = -J_speed * cross_matrix(*given - target_centre_);
  }
  const double rows =
      observation.px.y() / problem_.camera.height_px - 0.5;  // the time of an image is that of its central row
  J.col(num_lens + readout_cause) = rows * view.J_px_pose * twist;
  return J;
}

/// Empty if the point is not visible.
std::optional<PathSmoother::ObservationRows> PathSmoother::rows_of(const SmootherState& state, std::size_t i,
                                                                   const Twist& twist, bool has_given) const {
  const UsedObservation& observation = observations_[i];
  Feature feature;
  feature.values.head<3>() = state.points[point_of_[i]];
  const auto view = expected_view(state.camera, state.poses[observation.frame], feature);
  if (!view) return std::nullopt;
  const double weight = 1.0 / (error_factors_[point_of_[i]] * observation.sigma_px);
  ObservationRows rows{weight * (view->px - observation.px), weight * view->J_px_pose,
                       weight * view->J_px_feature.leftCols<3>(), GivenRows::Zero(2, num_estimated_)};
  if (has_given)
    rows.J_shared = weight * given_rows(*view, i, twist);
  else
    for (int k = 0; k < num_estimated_; ++k)
      rows.J_shared.col(k) = weight * view->J_px_lens.col(lens_order_[static_cast<std::size_t>(k)]);
  return rows;
}

/// Computes the rows of all frames before `to`. False if a point is not visible.
bool PathSmoother::look_ahead(const SmootherState& state, std::size_t to, bool has_given, Lookahead& rows) const {
  for (; rows.next < to; ++rows.next) {
    auto& of_frame = rows.of_frame[rows.next % rows.of_frame.size()];
    of_frame.clear();
    const Twist twist = has_given ? twist_at(state, rows.next) : Twist::Zero();
    for (std::size_t i = first_of_[rows.next]; i < first_of_[rows.next + 1]; ++i) {
      const auto each = rows_of(state, i, twist, has_given);
      if (!each) return false;
      of_frame.push_back(*each);
    }
  }
  return true;
}

namespace {

using Rows6 = Eigen::Matrix<double, 2, 6>;

/// Blocks of a pose of the window with itself, the point and the shared parameters. Written as products of two rows:
/// Eigen's general ones are slower here.
template <typename Shared>
void add_pose(int row, const Rows6& J, const Eigen::Matrix<double, 2, 3>& J_point, const Shared& J_shared,
              Eigen::Index shared_at, int at, const Eigen::Vector2d& error, PoseChain& chain) {
  chain.A.block<6, 6>(row, row) += J.transpose() * J;
  chain.U.block<6, 3>(row, at) += J.transpose() * J_point;
  for (Eigen::Index i = 0; i < J_shared.cols(); ++i)
    chain.U.block<6, 1>(row, shared_at + i) += J.transpose() * Eigen::Vector2d(J_shared.col(i));
  chain.a.segment<6>(row) -= J.transpose() * error;
}

template <typename Shared>
void add_point(const Eigen::Matrix<double, 2, 3>& J, const Shared& J_shared, Eigen::Index shared_at, int at,
               const Eigen::Vector2d& error, PoseChain& chain) {
  chain.B.block<3, 3>(at, at) += J.transpose() * J;
  chain.b.segment<3>(at) -= J.transpose() * error;
  for (Eigen::Index i = 0; i < J_shared.cols(); ++i) {
    const Eigen::Vector2d column = J_shared.col(i);
    chain.B.block<3, 1>(at, shared_at + i) += J.transpose() * column;
    for (Eigen::Index j = i; j < J_shared.cols(); ++j)
      chain.B(shared_at + j, shared_at + i) += column.dot(J_shared.col(j));
    chain.b[shared_at + i] -= column.dot(error);
  }
}

}  // namespace

/// Adds an observation of the window's pose at `row`, minus `share` times one of its first pose.
void PathSmoother::add(const ObservationRows& rows, const ObservationRows* before, double share, int row, int at,
                       SmootherSystem& system) const {
  PoseChain& chain = system.chain;
  ObservationRows now = rows;
  if (before != nullptr) {
    now.error -= share * before->error;
    now.J_point -= share * before->J_point;
    now.J_shared -= share * before->J_shared;
    const Rows6 J_before = -share * before->J_pose;
    add_pose(0, J_before, now.J_point, now.J_shared, lens_at_, at, now.error, chain);
    chain.A.block<6, 6>(row, 0) += now.J_pose.transpose() * J_before;
  }
  add_pose(row, now.J_pose, now.J_point, now.J_shared, lens_at_, at, now.error, chain);
  add_point(now.J_point, now.J_shared, lens_at_, at, now.error, chain);
  system.cost += now.error.squaredNorm();
  system.observed_cost += now.error.squaredNorm();
}

/// Adds the observations of frame k, the first of the window; with autocorrelation, those whose predecessor is in it.
bool PathSmoother::add_observations(const SmootherState& state, std::size_t k, Lookahead& rows,
                                    SmootherSystem& system) const {
  const std::size_t end = std::min(links_.empty() ? k + 1 : k + 3, state.poses.size());
  if (!look_ahead(state, end, system.has_given, rows)) return false;
  for (std::size_t frame = k; frame < end; ++frame) {
    for (std::size_t i = first_of_[frame]; i < first_of_[frame + 1]; ++i) {
      const Link link = links_.empty() ? Link{} : links_[i];
      const std::size_t added_at = link.before ? observations_[*link.before].frame : frame;
      if (added_at != k) continue;
      const int at = system.chain.place_of(point_of_[i]), row = 6 * static_cast<int>(frame - k);
      ObservationRows now = rows.of_frame[frame % 3][i - first_of_[frame]];
      now.error *= link.weight;
      now.J_pose *= link.weight;
      now.J_point *= link.weight;
      now.J_shared *= link.weight;
      const auto* before = link.before ? &rows.of_frame[k % 3][*link.before - first_of_[k]] : nullptr;
      add(now, before, link.weight * link.correlation, row, at, system);
    }
  }
  return true;
}

/// Models the errors of a point as a first-order autoregression: the innovations are independent and have a smaller σ
/// (D. Cochrane & G. Orcutt 1949). After a gap too long for the window an error starts again, with no more weight than
/// as a member of a sequence.
void PathSmoother::link_observations(double correlation) {
  std::map<long, std::size_t> last;
  link_correlation_ = correlation;
  links_.assign(observations_.size(), {});
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    const auto [at, is_first] = last.try_emplace(observations_[i].id, i);
    if (is_first) continue;
    const std::size_t gap = observations_[i].frame - observations_[at->second].frame;
    const double shared = std::pow(correlation, static_cast<double>(gap));
    links_[i].correlation = shared;
    constexpr std::size_t in_window = 2;
    if (gap <= in_window) links_[i].before = at->second;
    links_[i].weight =
        gap <= in_window ? 1.0 / std::sqrt(1.0 - shared * shared) : std::sqrt((1.0 - shared) / (1.0 + shared));
    at->second = i;
  }
}

std::vector<PlacedResidual> PathSmoother::placed_residuals() const {
  std::vector<PlacedResidual> residuals;
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    const UsedObservation& observation = observations_[i];
    const auto px = project(state_.camera, state_.poses[observation.frame].inverse() * state_.points[point_of_[i]]);
    if (!px) continue;
    residuals.push_back({observation.frame, observation.id, observation.px, observation.px - *px, observation.sigma_px,
                         error_factors_[point_of_[i]], i});
  }
  return residuals;
}

/// If errors of some points are larger than others', or errors are autocorrelated, solves again with σ per point, and
/// with the innovations of the errors. False if that does not converge.
bool PathSmoother::heed_colour() {
  constexpr double most = 0.98;
  constexpr double roughly = 0.3;
  constexpr int max_weighed = 2;
  structure_ = residual_structure(placed_residuals(), state_.camera);
  for (int i = 0; i < max_weighed && weigh_points(); ++i) {
    if (!settle(roughly) || (choose_observations() && !settle(roughly))) return false;
    structure_ = residual_structure(placed_residuals(), state_.camera);
  }
  if (structure_.is_autocorrelated()) link_observations(std::min(structure_.autocorrelation, most));
  return settle();
}

}  // namespace alidade
