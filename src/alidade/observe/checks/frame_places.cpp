#include "alidade/observe/checks/frame_places.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/observe/setup.h"

namespace alidade {
namespace {

constexpr std::size_t most_missing = 30;

/// The rotation of the image between two rows, over an assumed focal length, and how far points moved.
struct ImageTurn {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double moved_px = 0.0;  ///< Median.
};

/// Σ w J y by weighted least squares, where all of it is determined.
template <int Num>
Eigen::Matrix<double, Num, 1> solved(const Eigen::Matrix<double, Num, Num>& A, const Eigen::Matrix<double, Num, 1>& b) {
  constexpr double hardly = 1e-9;
  const double size = A.trace() / Num;
  Eigen::Matrix<double, Num, Num> damped = A;
  damped.diagonal().array() += hardly * size + 1e-300;
  return solve_symmetric(damped, b);
}

class Places {
 public:
  explicit Places(const RotationLog& log) : log_(log) {
    constexpr double max_gap_s = 0.25;
    MotionReader reader(log.source, max_gap_s);
    std::size_t segment = 0;
    for (const RotationRow& row : log.rows) {
      const RotationFrame frame = reader.next(row);
      segment += frame.starts_segment ? 1 : 0;
      segment_.push_back(segment);
      cam_from_start_.push_back(frame.cam_from_start);
      is_measured_.push_back(!frame.px.empty());
      for (const Eigen::Vector2d& px : row.px)
        if (is_seen(px)) {
          low_ = low_.cwiseMin(px);
          high_ = high_.cwiseMax(px);
        }
    }
    focal_px_ = std::max((high_ - low_).maxCoeff(), 1.0);
  }

  [[nodiscard]] FramePlaces found() {
    if (log_.rows.size() < 20 || !has_rate()) return {};
    FramePlaces places;
    for (int pass = 0; pass < 2; ++pass) {
      if (!fit(places)) return {};
      places = walk();
      if (places.are_as_given()) break;
    }
    return places;
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

  /// As measured, in the camera's axes; none across what was not.
  [[nodiscard]] std::optional<Eigen::Vector3d> measured(std::size_t from, std::size_t to) const {
    if (to >= cam_from_start_.size() || segment_[from] != segment_[to] || !is_measured_[from] || !is_measured_[to])
      return std::nullopt;
    return log_so3(cam_from_start_[to] * cam_from_start_[from].conjugate());
  }

  /// The flow of points by a small rotation, as all but a few of them have it.
  [[nodiscard]] std::optional<ImageTurn> seen(std::size_t from, std::size_t to) const {
    constexpr std::size_t enough = 4;
    const Eigen::Vector2d centre = 0.5 * (low_ + high_);
    std::vector<Eigen::Matrix<double, 2, 3>> J;
    std::vector<Eigen::Vector2d> flow;
    std::vector<double> moved_px;
    for (std::size_t i = 0; i < log_.num_points; ++i) {
      const Eigen::Vector2d &a = log_.rows[from].px[i], &b = log_.rows[to].px[i];
      if (!is_seen(a) || !is_seen(b)) continue;
      const Eigen::Vector2d p = (0.5 * (a + b) - centre) / focal_px_;
      J.emplace_back();
      J.back() << p.x() * p.y(), -(1.0 + p.x() * p.x()), p.y(), 1.0 + p.y() * p.y(), -p.x() * p.y(), -p.x();
      flow.push_back((b - a) / focal_px_);
      moved_px.push_back((b - a).norm());
    }
    if (flow.size() < enough) return std::nullopt;
    ImageTurn all{Eigen::Vector3d::Zero(), median_of(std::move(moved_px))};
    std::vector<double> weights(flow.size(), 1.0), off(flow.size());
    for (int i = 0; i < 4; ++i) {
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < flow.size(); ++k) {
        A += weights[k] * J[k].transpose() * J[k];
        b += weights[k] * J[k].transpose() * flow[k];
      }
      all.turn = solved<3>(A, b);
      for (std::size_t k = 0; k < flow.size(); ++k) off[k] = (flow[k] - J[k] * all.turn).norm();
      weigh(off, weights);
    }
    return all;
  }

  /// Beyond twice the median an error counts by its size alone (P. J. Huber 1964).
  static void weigh(const std::vector<double>& off, std::vector<double>& weights) {
    const double usual = 2.0 * median_of(off) + 1e-12;
    for (std::size_t k = 0; k < off.size(); ++k) weights[k] = usual / std::max(usual, off[k]);
  }

  /// What the image shows of a measured rotation: the mounting, and the focal length over the assumed one.
  [[nodiscard]] bool fit(const FramePlaces& places) {
    const std::vector<std::optional<std::size_t>> place = places_of(places);
    std::vector<Eigen::Vector3d> from, to;
    for (std::size_t k = 1; k < place.size(); ++k) {
      if (!place[k - 1] || !place[k]) continue;
      const auto turn = measured(*place[k - 1], *place[k]);
      const auto image = seen(k - 1, k);
      if (!turn || !image) continue;
      from.push_back(*turn);
      to.push_back(image->turn);
    }
    if (from.size() < 10) return false;
    std::vector<double> weights(from.size(), 1.0), off(from.size());
    for (int i = 0; i < 10; ++i) {
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), B = Eigen::Matrix3d::Zero();
      for (std::size_t k = 0; k < from.size(); ++k) {
        A += weights[k] * from[k] * from[k].transpose();
        B += weights[k] * from[k] * to[k].transpose();
      }
      for (Eigen::Index c = 0; c < 3; ++c) image_by_turn_.row(c) = solved<3>(A, B.col(c)).transpose();
      for (std::size_t k = 0; k < from.size(); ++k) off[k] = (to[k] - image_by_turn_ * from[k]).norm();
      weigh(off, weights);
    }
    usual_ = median_of(off);
    return true;
  }

  /// The row of each image's time; none of those that are no images of their own, or behind the end.
  [[nodiscard]] std::vector<std::optional<std::size_t>> places_of(const FramePlaces& places) const {
    std::vector<std::optional<std::size_t>> place(log_.rows.size());
    std::size_t later = 0;
    auto gap = places.missing.begin();
    for (std::size_t k = 0; k < place.size(); ++k) {
      for (; gap != places.missing.end() && gap->before == k; ++gap) later += static_cast<std::size_t>(gap->num);
      if (k + later < place.size() && !std::ranges::binary_search(places.repeated, k)) place[k] = k + later;
    }
    return place;
  }

  [[nodiscard]] FramePlaces walk() const {
    FramePlaces places;
    std::size_t last = 0, later = 0;
    std::vector<std::size_t> same;
    for (std::size_t k = 1; k < log_.rows.size(); ++k) {
      const auto image = seen(last, k);
      const auto turn = measured(last + later, k + later);
      if (!image || !turn) {
        last = k;
        same.clear();
        continue;
      }
      if (is_same(*image, *turn)) {
        same.push_back(k);
        continue;
      }
      if (off_by(*image, *turn) < 0.5 * off_by(*image, measured(k - 1 + later, k + later).value_or(*turn)))
        places.repeated.insert(places.repeated.end(), same.begin(), same.end());
      else if (!same.empty())
        last = k - 1;
      if (const int num = missing_before(last, k, later); num > 0) {
        places.missing.push_back({k, num});
        later += static_cast<std::size_t>(num);
      }
      last = k;
      same.clear();
    }
    constexpr double far_px = 5.0;  // a head whose backlash is taken up moves less
    if (const auto turn = measured(last + later, log_.rows.size() - 1); turn && !same.empty() && later == 0)
      if (focal_px_ * (image_by_turn_ * *turn).norm() > far_px)
        places.repeated.insert(places.repeated.end(), same.begin(), same.end());
    return places;
  }

  [[nodiscard]] double off_by(const ImageTurn& image, const Eigen::Vector3d& turn) const {
    return (image.turn - image_by_turn_ * turn).norm();
  }

  /// The same image again while the camera rotates: no finder puts points at the same hundredth in two.
  [[nodiscard]] bool is_same(const ImageTurn& image, const Eigen::Vector3d& turn) const {
    constexpr double still_px = 0.02, moves_px = 0.3;
    return image.moved_px < still_px && focal_px_ * (image_by_turn_ * turn).norm() > moves_px;
  }

  /// As many as the rotation of the image is further, where it is by much more than a step differs otherwise.
  [[nodiscard]] int missing_before(std::size_t last, std::size_t k, std::size_t later) const {
    constexpr double much = 6.0, most = 0.5, seen_px = 0.3, explained = 0.25;
    const auto image = seen(last, k);
    const auto turn = measured(last + later, k + later);
    if (!image || !turn) return 0;
    const double off = off_by(*image, *turn);
    if (off < much * usual_ || off < most * (image_by_turn_ * *turn).norm() || focal_px_ * off < seen_px) return 0;
    int best = 0;
    double least = explained * off;
    for (std::size_t num = 1; num <= most_missing; ++num) {
      const auto longer = measured(last + later, k + later + num);
      if (!longer) break;
      if (const double left = off_by(*image, *longer); left < least) {
        least = left;
        best = static_cast<int>(num);
      }
    }
    return best;
  }

  const RotationLog& log_;
  std::vector<Eigen::Quaterniond> cam_from_start_;
  std::vector<std::size_t> segment_;
  std::vector<bool> is_measured_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(1e12), high_ = Eigen::Vector2d::Constant(-1e12);
  double focal_px_ = 1.0;
  Eigen::Matrix3d image_by_turn_ = Eigen::Matrix3d::Identity();
  double usual_ = 0.0;  ///< By which a step's rotation differs.
};

}  // namespace

FramePlaces frame_places(const RotationLog& log) { return Places(log).found(); }

RotationLog placed(const RotationLog& log, const FramePlaces& places) {
  RotationLog moved = log;
  for (RotationRow& row : moved.rows) std::ranges::fill(row.px, Eigen::Vector2d::Constant(not_seen));
  std::size_t later = 0;
  auto gap = places.missing.begin();
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    for (; gap != places.missing.end() && gap->before == k; ++gap) later += static_cast<std::size_t>(gap->num);
    if (k + later >= log.rows.size()) break;
    if (!std::ranges::binary_search(places.repeated, k)) moved.rows[k + later].px = log.rows[k].px;
  }
  return moved;
}

Check places_check(const RotationLog& log, const FramePlaces& places) {
  constexpr std::size_t most_named = 3;
  std::string text;
  int num = 0;
  for (const FramePlaces::Gap& gap : places.missing) num += gap.num;
  if (num > 0) {
    text = std::to_string(num) + (num == 1 ? " frame is" : " frames are") + " missing:";
    for (std::size_t i = 0; i < std::min(most_named, places.missing.size()); ++i)
      text += (i == 0 ? " before " : ", ") + row_time_text(log.rows[places.missing[i].before].t_s) + " (" +
              std::to_string(places.missing[i].num) + ")";
    text += places.missing.size() > most_named ? " …" : "";
    text += "; the images behind are taken with the rotation of so many rows later: number them as they were taken";
  }
  if (!places.repeated.empty())
    text += (text.empty() ? "" : "; ") + std::to_string(places.repeated.size()) +
            (places.repeated.size() == 1 ? " image is" : " images are") +
            " the one before once more while the camera rotates, first at " +
            row_time_text(log.rows[places.repeated.front()].t_s) + ": rejected";
  return {"frames", State::care, text,       static_cast<double>(num) + static_cast<double>(places.repeated.size()),
          0.0,      "1",         "residuals"};
}

}  // namespace alidade
