#include "alidade/rig/checks/repeated_stops.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

using Corners = std::map<int, Eigen::Vector2d>;

Corners by_number(const BoardView& view) {
  Corners corners;
  for (const Corner& corner : view.corners) corners.emplace(corner.index, corner.px);
  return corners;
}

/// The views of a stop so far.
class Stop {
 public:
  Stop(const HeadView& first, std::size_t at) : first_(first), corners_(by_number(first.seen)), at_(at) { add(first); }

  [[nodiscard]] std::size_t at() const { return at_; }

  [[nodiscard]] bool has(const HeadView& view) const {
    constexpr double near_px = 1.0, near_rad = 0.1 * degree;
    if (view.board != first_.board || !((view.pan_tilt_rad - first_.pan_tilt_rad).cwiseAbs().maxCoeff() <= near_rad))
      return false;
    std::size_t common = 0;
    for (const Corner& corner : view.seen.corners) {
      const auto same = corners_.find(corner.index);
      if (same == corners_.end()) continue;
      if (!((corner.px - same->second).squaredNorm() <= near_px * near_px)) return false;
      ++common;
    }
    return common > 0 && 5 * common >= 4 * std::max(corners_.size(), view.seen.corners.size());
  }

  void add(const HeadView& view) {
    readings_.push_back(view.pan_tilt_rad);
    for (const Corner& corner : view.seen.corners) {
      auto& [sum, count] = sums_.try_emplace(corner.index, Eigen::Vector2d::Zero(), 0).first->second;
      sum += corner.px;
      ++count;
    }
  }

  /// The mean of its views, of the corners that the first has.
  void average(HeadView& first) const {
    first.pan_tilt_rad = mean_reading();
    for (Corner& corner : first.seen.corners) {
      const auto& [sum, count] = sums_.at(corner.index);
      corner.px = sum / count;
    }
  }

  [[nodiscard]] double squares_within() const {
    double squares = 0.0;
    for (const Eigen::Vector2d& reading : readings_) squares += (reading - mean_reading()).squaredNorm();
    return squares;
  }
  [[nodiscard]] double freedom_within() const { return 2.0 * static_cast<double>(readings_.size() - 1); }

 private:
  [[nodiscard]] Eigen::Vector2d mean_reading() const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& reading : readings_) sum += reading;
    return sum / static_cast<double>(readings_.size());
  }

  HeadView first_;
  Corners corners_;
  std::size_t at_;
  std::vector<Eigen::Vector2d> readings_;
  std::map<int, std::pair<Eigen::Vector2d, int>> sums_;
};

}  // namespace

AveragedStops averaged_stops(std::span<const HeadView> views) {
  AveragedStops result;
  std::map<int, Stop> last;  // of each head
  double squares = 0.0, freedom = 0.0;
  const auto leave = [&](const Stop& stop) {
    stop.average(result.views[stop.at()]);
    squares += stop.squares_within();
    freedom += stop.freedom_within();
  };
  for (const HeadView& view : views) {
    const auto stop = last.find(view.head);
    if (stop != last.end() && stop->second.has(view)) {
      stop->second.add(view);
      result.repeated.push_back({view.seen.photo, 0,
                                 "shows board " + std::to_string(view.board) + " where " +
                                     result.views[stop->second.at()].seen.photo + " does: averaged with it"});
      continue;
    }
    if (stop != last.end()) leave(stop->second);
    last.insert_or_assign(view.head, Stop(view, result.views.size()));
    result.views.push_back(view);
  }
  for (const auto& [head, stop] : last) leave(stop);
  if (freedom > 0.0) result.sigma_within_rad = std::sqrt(squares / freedom);
  return result;
}

}  // namespace alidade
