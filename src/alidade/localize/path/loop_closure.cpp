#include "alidade/localize/path/loop_closure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>

#include "alidade/estimation/median.h"
#include "alidade/localize/path/similarity_graph.h"

namespace alidade {
namespace {

/// The frames in which a point is seen.
struct PointTimes {
  std::size_t index = 0, first = 0, last = 0, num = 0;

  [[nodiscard]] std::size_t middle() const { return (first + last) / 2; }
};

struct LoopKeyframe {
  std::size_t frame = 0;
  std::vector<long> ids;
  double depth_m = 1.0;  ///< Median distance of its points.
};

/// The same point in the frames of two keyframes.
struct PairedPoint {
  Eigen::Vector3d first, second;
};

constexpr std::size_t min_paired = 8;

class LoopCloser {
 public:
  LoopCloser(const std::map<long, long>& number_of, SmootherProblem& problem)
      : number_of_(number_of), problem_(problem) {
    for (std::size_t i = 0; i < problem.points.size(); ++i) times_[problem.points[i].id].index = i;
    seen_.resize(problem.world_from_cam.size());
    for (const UsedObservation& observation : problem.observations) {
      const auto at = times_.find(observation.id);
      if (at == times_.end() || !observation.fits_start) continue;
      if (at->second.num++ == 0) at->second.first = observation.frame;
      at->second.last = observation.frame;
      seen_[observation.frame].push_back(observation.id);
    }
  }

  LoopClosure close(double max_at_once) {
    choose_keyframes();
    LoopClosure closure;
    std::vector<SimilarityEdge> edges = followed_edges();
    const std::size_t num_followed = edges.size();
    add_loops(edges);
    if (edges.size() == num_followed) return closure;
    std::vector<Similarity> begin;
    for (const LoopKeyframe& keyframe : keyframes_) begin.push_back({problem_.world_from_cam[keyframe.frame], 1.0});
    const auto graph = settled_graph(begin, edges);
    if (!graph) return closure;
    for (std::size_t i = num_followed; i < edges.size(); ++i)
      ++(graph->holds[i] ? closure.num_loops : closure.num_rejected);
    if (closure.num_loops == 0) return closure;
    for (std::size_t i = 0; i < begin.size(); ++i)
      corrections_.push_back(graph->world_from_keyframe[i] * inverse(begin[i]));
    correct();
    join(max_at_once, closure);
    return closure;
  }

 private:
  [[nodiscard]] long number(long id) const {
    const auto at = number_of_.find(id);
    return at == number_of_.end() ? id : at->second;
  }
  [[nodiscard]] const Eigen::Vector3d& place(long id) const {
    return problem_.points[times_.at(id).index].point_in_world;
  }

  /// Starts a new keyframe when less than 60 % of the last one's points are seen.
  void choose_keyframes() {
    constexpr double shared = 0.6;
    std::set<long> last;
    for (std::size_t k = 0; k < seen_.size(); ++k) {
      const auto num_shared = std::ranges::count_if(seen_[k], [&](long id) { return last.contains(id); });
      const bool is_end = k == 0 || k + 1 == seen_.size();
      if (!is_end &&
          (seen_[k].size() < min_paired || static_cast<double>(num_shared) > shared * static_cast<double>(last.size())))
        continue;
      last = {seen_[k].begin(), seen_[k].end()};
      LoopKeyframe keyframe{k, seen_[k], 1.0};
      std::vector<double> distances;
      for (const long id : keyframe.ids)
        distances.push_back((place(id) - problem_.world_from_cam[k].translation).norm());
      if (!distances.empty()) keyframe.depth_m = median_of(std::move(distances));
      keyframes_.push_back(std::move(keyframe));
    }
  }

  [[nodiscard]] std::vector<SimilarityEdge> followed_edges() const {
    constexpr double share = 0.01, sigma_rad = 0.005;
    std::vector<SimilarityEdge> edges;
    for (std::size_t i = 0; i + 1 < keyframes_.size(); ++i) {
      const Rigid3& from = problem_.world_from_cam[keyframes_[i].frame];
      const Rigid3& to = problem_.world_from_cam[keyframes_[i + 1].frame];
      edges.push_back({i, i + 1, {from.inverse() * to, 1.0}, sigma_rad, share * keyframes_[i].depth_m, share, false});
    }
    return edges;
  }

  /// Adds loop edges from each keyframe to the earlier ones with which it shares most points under other ids.
  void add_loops(std::vector<SimilarityEdge>& edges) const {
    constexpr std::size_t max_loops = 2;
    constexpr double share = 0.02, sigma_rad = 0.01;
    std::map<long, std::vector<std::pair<std::size_t, long>>> before;  // number → (keyframe, id)
    for (std::size_t j = 0; j < keyframes_.size(); ++j) {
      std::map<std::size_t, std::vector<PairedPoint>> paired;
      const Rigid3 here = problem_.world_from_cam[keyframes_[j].frame].inverse();
      for (const long id : keyframes_[j].ids) {
        const auto at = before.find(number(id));
        if (at == before.end()) continue;
        for (const auto& [i, other] : at->second)
          if (other != id)
            paired[i].push_back(
                {problem_.world_from_cam[keyframes_[i].frame].inverse() * place(other), here * place(id)});
      }
      std::vector<std::pair<std::size_t, std::size_t>> by_number;
      for (const auto& [i, points] : paired)
        if (points.size() >= min_paired) by_number.emplace_back(points.size(), i);
      std::ranges::sort(by_number, std::greater{});
      if (by_number.size() > max_loops) by_number.resize(max_loops);
      for (const auto& [num, i] : by_number)
        if (const auto first_from_second = agreed(paired[i]))
          edges.push_back({i, j, *first_from_second, sigma_rad, share * keyframes_[i].depth_m, share, true});
      for (const long id : keyframes_[j].ids) before[number(id)].emplace_back(j, id);
    }
  }

  /// RANSAC for the similarity with most inliers (M. A. Fischler & R. C. Bolles 1981). Empty if fewer than half agree.
  [[nodiscard]] static std::optional<Similarity> agreed(std::span<const PairedPoint> points) {
    constexpr int num_draws = 60, num_refined = 2;
    constexpr double near_share = 0.06;  // of the distance: the depth error of a camera that moves sideways
    std::mt19937_64 bits(1);
    std::vector<std::size_t> best;
    const auto fitted = [&](std::span<const std::size_t> chosen) {
      std::vector<Eigen::Vector3d> first, second;
      for (const std::size_t i : chosen) {
        first.push_back(points[i].first);
        second.push_back(points[i].second);
      }
      return aligned(second, first, false);
    };
    const auto near = [&](const Similarity& first_from_second) {
      std::vector<std::size_t> agreeing;
      for (std::size_t i = 0; i < points.size(); ++i)
        if ((first_from_second * points[i].second - points[i].first).norm() < near_share * points[i].first.norm())
          agreeing.push_back(i);
      return agreeing;
    };
    for (int k = 0; k < num_draws; ++k) {
      const std::array<std::size_t, 3> three{bits() % points.size(), bits() % points.size(), bits() % points.size()};
      if (three[0] == three[1] || three[0] == three[2] || three[1] == three[2]) continue;
      const auto similarity = fitted(three);
      if (!similarity) continue;
      std::vector<std::size_t> agreeing = near(*similarity);
      if (agreeing.size() > best.size()) best = std::move(agreeing);
    }
    std::optional<Similarity> similarity;
    for (int k = 0; k < num_refined; ++k) {
      if (best.size() < min_paired || 2 * best.size() < points.size()) return std::nullopt;
      similarity = fitted(best);
      if (!similarity) return std::nullopt;
      best = near(*similarity);
    }
    return similarity;
  }

  /// Corrects a pose of a frame by interpolating the corrections of the keyframes around it.
  [[nodiscard]] Rigid3 corrected(std::size_t frame, const Rigid3& world_from_cam) const {
    const auto after = std::ranges::lower_bound(keyframes_, frame, {}, &LoopKeyframe::frame);
    const auto j = static_cast<std::size_t>(after - keyframes_.begin()), i = after->frame == frame ? j : j - 1;
    const double span = i == j ? 1.0 : static_cast<double>(keyframes_[j].frame - keyframes_[i].frame);
    const double share = static_cast<double>(frame - keyframes_[i].frame) / span;
    const Similarity &a = corrections_[i], &b = corrections_[j];
    return {(a.b_from_a.rotation.slerp(share, b.b_from_a.rotation) * world_from_cam.rotation).normalized(),
            (1.0 - share) * (a * world_from_cam.translation) + share * (b * world_from_cam.translation)};
  }

  void correct() {
    for (const auto& [id, times] : times_) {
      if (times.num == 0) continue;
      SmootherPoint& point = problem_.points[times.index];
      point.point_in_world =
          corrected(times.middle(), {Eigen::Quaterniond::Identity(), point.point_in_world}).translation;
    }
    for (std::size_t k = 0; k < problem_.world_from_cam.size(); ++k)
      problem_.world_from_cam[k] = corrected(k, problem_.world_from_cam[k]);
  }

  /// Points with the same number whose positions now agree.
  struct Candidate {
    std::vector<long> ids;  ///< In order of time.
    std::size_t num = 0;
  };

  [[nodiscard]] std::map<std::size_t, std::vector<Candidate>> candidates() const {
    std::map<long, std::vector<long>> ids_of;
    for (const auto& [id, times] : times_)
      if (times.num > 1 && !problem_.points[times.index].given_in_world) ids_of[number(id)].push_back(id);
    std::map<std::size_t, std::vector<Candidate>> by_keyframe;
    for (auto& [number, ids] : ids_of) {
      std::ranges::sort(ids, {}, [&](long id) { return times_.at(id).first; });
      const PointTimes& first = times_.at(ids.front());
      const double distance = (place(ids.front()) - problem_.world_from_cam[first.middle()].translation).norm();
      constexpr double near_share = 0.1;
      const Eigen::Vector3d& there = place(ids.front());
      std::erase_if(ids, [&](long id) { return (place(id) - there).norm() > near_share * distance; });
      Candidate candidate{ids, 0};
      for (const long id : ids) candidate.num += times_.at(id).num;
      const auto keyframe = std::ranges::lower_bound(keyframes_, first.middle(), {}, &LoopKeyframe::frame);
      if (ids.size() > 1)
        by_keyframe[static_cast<std::size_t>(keyframe - keyframes_.begin())].push_back(std::move(candidate));
    }
    for (auto& [keyframe, list] : by_keyframe) std::ranges::stable_sort(list, std::greater{}, &Candidate::num);
    return by_keyframe;
  }

  /// Merges candidates round-robin over the keyframes.
  void join(double max_at_once, LoopClosure& closure) {
    std::vector<int> num_at(problem_.world_from_cam.size(), 0);
    for (const auto& [id, times] : times_)
      if (times.num > 0)
        for (std::size_t k = times.first; k <= times.last; ++k) ++num_at[k];
    const auto by_keyframe = candidates();
    bool has_more = true;
    for (std::size_t rank = 0; has_more; ++rank) {
      has_more = false;
      for (const auto& [keyframe, list] : by_keyframe) {
        if (rank >= list.size()) continue;
        has_more = true;
        if (fits(list[rank], max_at_once, num_at)) {
          take(list[rank]);
          ++closure.num_joined;
        }
      }
    }
    apply();
  }

  /// Whether there is room for it in the frames between its observations; if so, reserves it.
  [[nodiscard]] bool fits(const Candidate& candidate, double max_at_once, std::vector<int>& num_at) const {
    for (const int share : {0, 1}) {  // first pass: check; second pass: reserve
      for (std::size_t i = 0; i + 1 < candidate.ids.size(); ++i)
        for (std::size_t k = times_.at(candidate.ids[i]).last + 1; k < times_.at(candidate.ids[i + 1]).first; ++k) {
          num_at[k] += share;
          if (share == 0 && num_at[k] + 1 > max_at_once) return false;
        }
    }
    return true;
  }

  void take(const Candidate& candidate) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const long id : candidate.ids) sum += place(id);
    SmootherPoint& first = problem_.points[times_.at(candidate.ids.front()).index];
    first.point_in_world = sum / static_cast<double>(candidate.ids.size());
    for (const long id : candidate.ids)
      first.error_factor = std::max(first.error_factor, problem_.points[times_.at(id).index].error_factor);
    for (std::size_t i = 1; i < candidate.ids.size(); ++i) joined_[candidate.ids[i]] = candidate.ids.front();
  }

  void apply() {
    std::erase_if(problem_.points, [&](const SmootherPoint& point) { return joined_.contains(point.id); });
    for (UsedObservation& observation : problem_.observations)
      if (const auto at = joined_.find(observation.id); at != joined_.end()) observation.id = at->second;
  }

  const std::map<long, long>& number_of_;
  SmootherProblem& problem_;
  std::map<long, PointTimes> times_;
  std::vector<std::vector<long>> seen_;
  std::vector<LoopKeyframe> keyframes_;
  std::vector<Similarity> corrections_;  ///< For each keyframe: new pose from old pose.
  std::map<long, long> joined_;
};

}  // namespace

LoopClosure close_loops(const std::map<long, long>& number_of, double max_at_once, SmootherProblem& problem) {
  if (number_of.empty() || problem.world_from_cam.empty()) return {};
  return LoopCloser(number_of, problem).close(max_at_once);
}

bool fits_as_well(const SmoothedPath& closed, const SmoothedPath& open, std::size_t num_joined, double gate) {
  constexpr double most_a_point = 100.0;
  const double rise = cost_of(closed, gate, CostBy::found_sigma) - cost_of(open, gate, CostBy::found_sigma);
  return rise < most_a_point * static_cast<double>(num_joined);
}

}  // namespace alidade
