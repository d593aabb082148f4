#include "alidade/observe/checks/frame_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/checks/image_turn.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/observe/setup.h"

namespace alidade {
namespace {

constexpr int most_missing = 30;  // rows in one gap

/// A measured rotation and its change from row to row; and the linear map from it to the rotation of the image.
using Turn = Eigen::Matrix<double, 6, 1>;
using ImageByTurn = Eigen::Matrix<double, 3, 6>;

/// A step from an image to the next different one; `image` is none if they have too few points in common.
struct Step {
  std::size_t from = 0, to = 0;
  std::optional<ImageTurn> image;
};

class Places {
 public:
  explicit Places(const RotationLog& log) : log_(log) {
    constexpr double max_gap_s = 0.25;
    MotionReader reader(log.source, max_gap_s);
    std::size_t segment = 0;
    Eigen::Vector2d low = Eigen::Vector2d::Constant(1e12), high = -low;
    for (const RotationRow& row : log.rows) {
      const RotationFrame frame = reader.next(row);
      segment += frame.starts_segment ? 1 : 0;
      segment_.push_back(segment);
      cam_from_start_.push_back(frame.cam_from_start);
      is_measured_.push_back(!frame.px.empty());
      for (const Eigen::Vector2d& px : row.px)
        if (is_seen(px)) {
          low = low.cwiseMin(px);
          high = high.cwiseMax(px);
        }
    }
    focal_px_ = std::max((high - low).maxCoeff(), 1.0);
    centre_ = 0.5 * (low + high);
    for (std::size_t k = 0; k < cam_from_start_.size(); ++k) next_.push_back(rotated(k, k + 1));
    std::vector<std::optional<Turn>> turns;
    for (std::size_t k = 0; k < next_.size(); ++k) turns.push_back(measured(k, k + 1));
    next_turn_ = std::move(turns);
  }

  [[nodiscard]] FramePlaces found() {
    if (log_.rows.size() < 20 || !has_rate()) return {};
    note_steps();
    const auto as_given = fitted(std::vector<int>(steps_.size() + 1, 0));
    if (!as_given) return {};
    std::vector<Path> paths{*as_given};
    constexpr std::size_t few = 30;
    for (const std::size_t first : {few, steps_.size()})
      if (const auto path = placed_from(first)) paths.push_back(*path);
    if (const auto path = placed_one_by_one()) paths.push_back(*path);
    usual_ = std::ranges::min_element(paths, {}, &Path::usual)->usual;
    const auto cost = [&](const Path& path) {
      image_by_turn_ = path.image_by_turn;
      return cost_of(path.later);
    };
    constexpr double clearly = 10.0;
    const double cost_as_given = cost(*as_given);
    auto best = std::ranges::min_element(paths, {}, cost);
    if (cost(*best) + clearly > cost_as_given) best = paths.begin();
    image_by_turn_ = best->image_by_turn;
    return places_of(best->later);
  }

 private:
  [[nodiscard]] bool has_rate() const {
    std::vector<double> gaps_s;
    for (std::size_t k = 1; k < log_.rows.size(); ++k) gaps_s.push_back(log_.rows[k].t_s - log_.rows[k - 1].t_s);
    const double period_s = median_of(gaps_s);
    constexpr double even = 0.05;
    const auto num_even =
        std::ranges::count_if(gaps_s, [&](double gap_s) { return std::abs(gap_s - period_s) < even * period_s; });
    return static_cast<std::size_t>(20 * num_even) >= 19 * gaps_s.size();
  }

  /// Measured rotation between two rows, in camera axes; none across rows that were not measured.
  [[nodiscard]] std::optional<Eigen::Vector3d> rotated(std::size_t from, std::size_t to) const {
    if (std::max(from, to) >= cam_from_start_.size() || segment_[from] != segment_[to] || !is_measured_[from] ||
        !is_measured_[to])
      return std::nullopt;
    if (to == from + 1 && from < next_.size()) return next_[from];
    return log_so3(cam_from_start_[to] * cam_from_start_[from].conjugate());
  }

  /// The same with its change from row to row, by which a delay of less than a row acts.
  [[nodiscard]] std::optional<Turn> measured(std::size_t from, std::size_t to) const {
    if (to == from + 1 && from < next_turn_.size()) return next_turn_[from];
    const auto now = rotated(from, to);
    if (!now) return std::nullopt;
    Turn turn = Turn::Zero();
    turn.head<3>() = *now;
    const auto before = rotated(from - 1, to - 1), after = rotated(from + 1, to + 1);
    if (before && after) turn.tail<3>() = 0.5 * (*after - *before);
    return turn;
  }

  /// Finds the images that differ from the one before, and by how much; an identical image is not a step.
  void note_steps() {
    constexpr double still_px = 0.02;  // no detector repeats its points to a hundredth of a pixel in two images
    std::size_t last = 0;
    for (std::size_t k = 1; k < log_.rows.size(); ++k) {
      const auto image = image_turn(log_.rows[last], log_.rows[k], centre_, focal_px_);
      if (image && image->moved_px < still_px) continue;
      steps_.push_back({last, k, image});
      last = k;
    }
  }

  /// Per image, how many rows after its own it was taken; and the fit of image rotation to measured rotation.
  struct Path {
    std::vector<int> later;
    ImageByTurn image_by_turn;
    double usual;
  };

  [[nodiscard]] std::optional<Path> fitted(std::vector<int> later) {
    if (!fit(later, steps_.size(), true)) return std::nullopt;
    return Path{std::move(later), image_by_turn_, usual_};
  }

  /// Fits the first `first` images, then ever more: a fit to many misplaced images would be
  /// wrong. As a fit to partly misplaced images has large errors, gaps are searched with
  /// half of its typical error. The delay is estimated only when all images are placed.
  [[nodiscard]] std::optional<Path> placed_from(std::size_t first) {
    constexpr double longer = 1.2, much_longer = 1.6, ready = 0.5;
    constexpr std::size_t many = 300;  // with so many images, the new ones hardly change the fit
    constexpr int passes = 4;
    std::vector<int> later(steps_.size() + 1, 0);
    for (auto longest = static_cast<double>(first);; longest *= longest < many ? longer : much_longer) {
      const std::size_t num = std::min(static_cast<std::size_t>(longest), steps_.size());
      for (int pass = 0; pass < passes; ++pass) {
        if (!fit(later, num, false)) return std::nullopt;
        usual_ *= ready;
        if (!changes(later, num)) break;
      }
      if (num == steps_.size()) break;
    }
    for (int pass = 0; pass < passes; ++pass) {
      if (!fit(later, steps_.size(), true)) return std::nullopt;
      if (!changes(later, steps_.size())) break;
    }
    return fitted(std::move(later));
  }

  /// Places each gap separately, where the error of a step is far above the typical error.
  [[nodiscard]] std::optional<Path> placed_one_by_one() {
    std::vector<int> later(steps_.size() + 1, 0);
    for (int pass = 0; pass < 2; ++pass) {
      if (!fit(later, steps_.size(), false)) return std::nullopt;
      for (std::size_t j = 0; j < steps_.size(); ++j) later[j + 1] = later[j] + missing_before(steps_[j], later[j]);
    }
    return fitted(std::move(later));
  }

  /// Number of missing rows that explains most of the step's error; 0 if none does.
  [[nodiscard]] int missing_before(const Step& step, int later) const {
    constexpr double much = 6.0, most = 0.5, seen_px = 0.3, explained = 0.25;
    const auto turn = measured(row(step.from, later), row(step.to, later));
    if (!step.image || !turn) return 0;
    const double off = off_by(*step.image, *turn);
    if (off < much * usual_ || off < most * (image_by_turn_ * *turn).norm() || focal_px_ * off < seen_px) return 0;
    int best = 0;
    double least = explained * off;
    for (int num = 1; num <= most_missing; ++num) {
      const auto longer = measured(row(step.from, later), row(step.to, later + num));
      if (!longer) break;
      if (const double left = off_by(*step.image, *longer); left < least) {
        least = left;
        best = num;
      }
    }
    return best;
  }

  /// Replaces the path by the likeliest one over the first `num` steps; returns whether it changed.
  [[nodiscard]] bool changes(std::vector<int>& later, std::size_t num) const {
    std::vector<int> again = likeliest_path(num);
    if (again == later) return false;
    later = std::move(again);
    return true;
  }

  /// Fits the map from measured rotation to image rotation: the mounting, and focal length over the assumed one.
  [[nodiscard]] bool fit(const std::vector<int>& later, std::size_t num, bool knows_delay) {
    std::vector<Turn> from;
    std::vector<Eigen::Vector3d> to;
    for (std::size_t j = 0; j < num; ++j) {
      const auto turn = measured(row(steps_[j].from, later[j]), row(steps_[j].to, later[j + 1]));
      if (!turn || !steps_[j].image) continue;
      from.push_back(*turn);
      if (!knows_delay) from.back().tail<3>().setZero();
      to.push_back(steps_[j].image->turn);
    }
    if (from.size() < 15) return false;
    std::vector<double> weights(from.size(), 1.0), off(from.size());
    for (int i = 0; i < 10; ++i) {
      Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 3> B = Eigen::Matrix<double, 6, 3>::Zero();
      for (std::size_t k = 0; k < from.size(); ++k) {
        A += weights[k] * from[k] * from[k].transpose();
        B += weights[k] * from[k] * to[k].transpose();
      }
      for (Eigen::Index c = 0; c < 3; ++c) image_by_turn_.row(c) = solved<6>(A, B.col(c)).transpose();
      for (std::size_t k = 0; k < from.size(); ++k) off[k] = (to[k] - image_by_turn_ * from[k]).norm();
      weigh_errors(off, weights);
    }
    usual_ = std::max(median_of(off), 1e-12);
    return true;
  }

  /// Cost of a step between images placed at the given offsets, in squares of the typical error; beyond the end of the
  /// log, that of twice the typical error. None: a gap with too few images after it, or one that explains little.
  [[nodiscard]] std::optional<double> cost_of(const Step& step, int later_from, int later_to) const {
    constexpr double most = 100.0, outside = 4.0, fits = 3.0, explained = 0.3;
    constexpr std::size_t fewest_behind = 3;
    const std::size_t from = row(step.from, later_from), to = row(step.to, later_to), num = log_.rows.size();
    if (later_to > later_from && (from >= num || to + fewest_behind >= num)) return std::nullopt;
    if (from >= num || to >= num) return later_to < 0 ? most : outside;
    const auto turn = step.image ? measured(from, to) : std::nullopt;
    if (!turn) return later_from == later_to ? std::optional(0.0) : std::nullopt;
    const double off = off_by(*step.image, *turn) / usual_;
    if (later_to > later_from && off > fits) {
      const auto without = measured(from, row(step.to, later_from));
      if (!without || off * usual_ > explained * off_by(*step.image, *without)) return std::nullopt;
    }
    return std::min(off * off, most);
  }

  [[nodiscard]] double cost_of(const std::vector<int>& later) const {
    double cost = 0.0;
    for (std::size_t j = 0; j < steps_.size(); ++j)
      cost += cost_of(steps_[j], later[j], later[j + 1]).value_or(0.0) + change_cost(later[j + 1] - later[j]);
    return cost;
  }

  [[nodiscard]] static double change_cost(int later) {
    constexpr double gap = 60.0, inserted = 4.0;
    return later > 0 ? gap : -inserted * later;
  }

  /// Best path up to an image for one offset: its cost, and the offset of the image before.
  struct Way {
    double cost = 0.0;
    int from = 0;
  };
  using Ways = std::map<int, Way>;

  static void offer(Ways& ways, int later, double cost, int from) {
    const auto [at, is_new] = ways.try_emplace(later, Way{cost, from});
    if (!is_new && cost < at->second.cost) at->second = {cost, from};
  }

  /// Extends all paths by one step: same offset; smaller after an inserted image; larger after a gap.
  [[nodiscard]] Ways next_ways(const Ways& ways, const Step& step) const {
    constexpr double open = 20.0, fits = 4.0, beam = 150.0, moves_px = 0.3;
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [later, way] : ways) least = std::min(least, way.cost);
    const bool moves = step.image && step.image->moved_px > moves_px;
    const int num_same = std::min(static_cast<int>(step.to - step.from) - 1, most_missing);
    Ways next;
    for (const auto& [later, way] : ways) {
      if (way.cost > least + beam) continue;
      const auto go = [&, later = later, cost = way.cost](int to) {
        const auto own = cost_of(step, later, to);
        if (own) offer(next, to, cost + change_cost(to - later) + *own, later);
        return own;
      };
      const double as_before = go(later).value_or(0.0);
      for (int num = 1; num <= num_same; ++num) go(later - num);
      if (!moves || way.cost > least + open || as_before < fits) continue;
      for (int num = 1; num <= most_missing; ++num) go(later + num);
    }
    return next;
  }

  /// Number of rows by which each image is late, for the first image and after each step:
  /// dynamic programming over all images, since a gap during which the camera hardly rotates
  /// shows only in later steps (A. J. Viterbi 1967). A constant offset is allowed: a delay.
  [[nodiscard]] std::vector<int> likeliest_path(std::size_t num) const {
    constexpr int max_delay = 15;
    constexpr double delay_cost = 3.0;
    std::vector<Ways> ways(1);
    for (int later = -max_delay; later <= max_delay; ++later) ways[0][later] = {delay_cost * std::abs(later), later};
    for (std::size_t j = 0; j < num; ++j) ways.push_back(next_ways(ways.back(), steps_[j]));
    const auto best = std::ranges::min_element(ways.back(), {}, [](const auto& each) { return each.second.cost; });
    std::vector<int> path(steps_.size() + 1, best->first);
    for (std::size_t j = ways.size() - 1; j > 0; --j) path[j - 1] = ways[j].at(path[j]).from;
    return path;
  }

  /// Converts the path to rows that are missing or repeated; the delay of the first image is subtracted.
  [[nodiscard]] FramePlaces places_of(const std::vector<int>& later) const {
    FramePlaces places;
    std::vector<int> own(log_.rows.size(), 0);
    for (std::size_t j = 0; j < steps_.size(); ++j) {
      const Step& step = steps_[j];
      const int gap = later[j + 1] - later[j];
      if (gap > 0) places.missing.push_back({step.to, gap});
      const bool is_repeated = step.to > step.from + 1 && (gap < 0 || makes_up(step, later[j], later[j + 1]));
      for (std::size_t k = step.from + 1; k < step.to; ++k) {
        own[k] = later[j] - later[0];
        if (is_repeated) places.repeated.push_back(k);
      }
      if (gap < 0) places.num_inserted -= gap;
      own[step.to] = later[j + 1] - later[0];
    }
    const std::size_t last = steps_.empty() ? 0 : steps_.back().to;
    for (std::size_t k = last + 1; k < own.size(); ++k) own[k] = later.back() - later[0];
    constexpr double far_px = 5.0;  // a head that takes up its backlash moves less
    if (const auto turn = measured(row(last, later.back()), log_.rows.size() - 1); turn && places.missing.empty())
      if (focal_px_ * (image_by_turn_ * *turn).norm() > far_px)
        for (std::size_t k = last + 1; k < own.size(); ++k) places.repeated.push_back(k);
    if (!places.are_as_given()) places.later = std::move(own);
    return places;
  }

  /// Whether the image after repeated ones has rotated as the camera did since the first of them, not since the last.
  [[nodiscard]] bool makes_up(const Step& step, int later_from, int later_to) const {
    const auto since_first = measured(row(step.from, later_from), row(step.to, later_to));
    const auto since_last = measured(row(step.to, later_to) - 1, row(step.to, later_to));
    const auto meanwhile = measured(row(step.from, later_from), row(step.to, later_to) - 1);
    constexpr double moves_px = 0.3;  // pixels rounded to 0.1 px may stay the same while a head hardly rotates
    return step.image && since_first && since_last && meanwhile &&
           focal_px_ * (image_by_turn_ * *meanwhile).norm() > moves_px &&
           off_by(*step.image, *since_first) < 0.5 * off_by(*step.image, *since_last);
  }

  [[nodiscard]] double off_by(const ImageTurn& image, const Turn& turn) const {
    return (image.turn - image_by_turn_ * turn).norm();
  }

  /// May lie beyond the log, also for negative results, which wrap around.
  [[nodiscard]] static std::size_t row(std::size_t image, int later) {
    return image + static_cast<std::size_t>(static_cast<std::ptrdiff_t>(later));
  }

  const RotationLog& log_;
  std::vector<Eigen::Quaterniond> cam_from_start_;
  std::vector<std::size_t> segment_;
  std::vector<bool> is_measured_;
  std::vector<std::optional<Eigen::Vector3d>> next_;  ///< Rotation to the next row.
  std::vector<std::optional<Turn>> next_turn_;        ///< The same with its change.
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
  double focal_px_ = 1.0;
  ImageByTurn image_by_turn_ = ImageByTurn::Zero();
  std::vector<Step> steps_;
  double usual_ = 0.0;  ///< Typical (median) error of a step's rotation.
};

}  // namespace

FramePlaces frame_places(const RotationLog& log) { return Places(log).found(); }

}  // namespace alidade
