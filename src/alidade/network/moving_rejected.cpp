#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "alidade/network/moving_solve.h"

namespace alidade {
namespace {

using Rejections = std::vector<std::pair<double, bool>>;  // time, in order; was it rejected?

double share_of(const Rejections& all) {
  const auto num = std::ranges::count_if(all, [](const auto& one) { return one.second; });
  return all.empty() ? 0.0 : static_cast<double>(num) / static_cast<double>(all.size());
}

/// The moment by which they are split most clearly, if one side is rejected and the other is not.
std::optional<SplitMoment> split_moment(const Rejections& all) {
  constexpr double nearly_all = 0.8, few = 0.35, least_share = 0.05;
  std::vector<double> before{0.0};  // rejected
  for (const auto& [t_s, is_rejected] : all) before.push_back(before.back() + (is_rejected ? 1.0 : 0.0));
  const auto num = static_cast<double>(all.size());
  double most = 0.0;
  std::optional<SplitMoment> moment;
  for (std::size_t k = 1; k < all.size(); ++k) {
    const double first = static_cast<double>(k), second = num - first;
    if (std::min(first, second) < least_share * num) continue;
    const double a = before[k] / first, b = (before.back() - before[k]) / second;
    const double clear = std::abs(a - b) * std::sqrt(first * second);
    if (!(clear > most)) continue;
    most = clear;
    moment.reset();
    if (std::max(a, b) > nearly_all && std::min(a, b) < few)
      moment = SplitMoment{0.5 * (all[k - 1].first + all[k].first), a < b};
  }
  return moment;
}

}  // namespace

void note_rejected(const MovingProblem& problem, const SolvedMoving& solved, std::vector<LocatedCamera>& cameras) {
  std::vector<Rejections> of_head(cameras.size());
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (!solved.residual_px[i].allFinite()) continue;
    const SolvedObservation& observation = problem.observations[i];
    of_head[observation.head].emplace_back(observation.t_s, !solved.used[i]);
  }
  for (std::size_t h = 0; h < cameras.size(); ++h) {
    if (!cameras[h].placed) continue;
    std::ranges::sort(of_head[h]);
    cameras[h].rejected = share_of(of_head[h]);
    cameras[h].moved = split_moment(of_head[h]);
  }
}

void note_disagreement(const MovingProblem& problem, const MovingState& state,
                       std::span<const ObservationSeries> series, std::span<const double> path_t_s,
                       MovingTargetReport& report) {
  constexpr double piece_s = 1.0;
  const auto piece_of = [](double t_s) { return static_cast<long>(std::floor(t_s / piece_s)); };
  std::map<long, std::set<std::size_t>> watched;
  for (std::size_t h = 0; h < series.size(); ++h)
    for (std::size_t k = 0; problem.placed[h] && k < series[h].t_s.size(); ++k)
      watched[piece_of(state.rig_time(problem, h, series[h].t_s[k]))].insert(h);
  std::set<long> known;
  for (const double t_s : path_t_s) known.insert(piece_of(t_s));
  Rejections pieces;
  for (const auto& [piece, heads] : watched)
    if (heads.size() > 1) pieces.emplace_back((static_cast<double>(piece) + 0.5) * piece_s, !known.contains(piece));
  report.agreeing = 1.0 - share_of(pieces);
  report.disagree = split_moment(pieces);
}

}  // namespace alidade
