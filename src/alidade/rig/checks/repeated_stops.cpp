#include "alidade/rig/checks/repeated_stops.h"

#include <cmath>
#include <map>

#include "alidade/board/same_place.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// The views of a stop so far.
class Stop {
 public:
  Stop(const HeadView& first, std::size_t at) : first_(first), at_(at) { add(first); }

  [[nodiscard]] std::size_t at() const { return at_; }

  [[nodiscard]] bool has(const HeadView& view) const {
    constexpr double near_px = 1.0, near_rad = 0.1 * degree;
    return view.board == first_.board && (view.pan_tilt_rad - first_.pan_tilt_rad).cwiseAbs().maxCoeff() <= near_rad &&
           at_one_place(first_.seen, view.seen, near_px);
  }

  void add(const HeadView& view) {
    readings_.push_back(view.pan_tilt_rad);
    seen_.push_back(view.seen);
  }

  [[nodiscard]] HeadView averaged() const {
    HeadView view = first_;
    view.pan_tilt_rad = mean_reading();
    view.seen.corners = mean_corners(seen_);
    return view;
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
  std::size_t at_;
  std::vector<Eigen::Vector2d> readings_;
  std::vector<BoardView> seen_;
};

/// For each view the number of an earlier one of its head that is the same image.
std::vector<std::optional<std::size_t>> same_images(std::span<const HeadView> views) {
  std::map<int, std::vector<std::size_t>> of_head;
  for (std::size_t v = 0; v < views.size(); ++v) of_head[views[v].head].push_back(v);
  std::vector<std::optional<std::size_t>> same(views.size());
  for (const auto& [head, numbers] : of_head) {
    std::vector<BoardView> seen;
    for (const std::size_t v : numbers) seen.push_back(views[v].seen);
    const auto repeats = repeated_views(seen);
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (repeats[i]) same[numbers[i]] = numbers[*repeats[i]];
  }
  return same;
}

}  // namespace

AveragedStops averaged_stops(std::span<const HeadView> views) {
  AveragedStops result;
  std::map<int, Stop> last;  // of each head
  double squares = 0.0, freedom = 0.0;
  const auto leave = [&](const Stop& stop) {
    if (!(stop.freedom_within() > 0.0)) return;
    result.views[stop.at()] = stop.averaged();
    squares += stop.squares_within();
    freedom += stop.freedom_within();
  };
  const auto same = same_images(views);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const HeadView& view = views[v];
    if (same[v]) {
      result.repeated.push_back({view.seen.photo, 0, "is the same image as " + views[*same[v]].seen.photo});
      continue;
    }
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
