#include "alidade/localize/checks/missing_frames.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr std::size_t wide = 16, narrow = 5, least_aside = 3;  ///< Frames on each side of a step.
constexpr int most_missing = 30;

/// A longer step, and twice the gain of log likelihood by it.
struct LongerStep {
  int num = 0;
  double gain = 0.0;
};

class PathTimes {
 public:
  explicit PathTimes(std::span<const PathStep> path) {
    for (std::size_t k = 0; k < path.size(); ++k)
      if (path[k].has_pose() && path[k].event != FrameEvent::predicted) {
        steps_.push_back(&path[k]);
        index_.push_back(k);
      }
    missing_.assign(steps_.size(), 0);
    best_.resize(steps_.size());
  }

  [[nodiscard]] std::vector<MissingFrames> found() {
    if (!has_period()) return {};
    suppose_every();
    look_again(0, steps_.size());
    const std::size_t most_changes = steps_.size();
    for (std::size_t i = 0; i < most_changes; ++i) {
      const auto best = std::ranges::max_element(best_, {}, &LongerStep::gain);
      if (!(best->gain > sure)) break;
      const auto k = static_cast<std::size_t>(best - best_.begin());
      missing_[k] = best->num;
      look_again(k - std::min(k, 2 * wide), std::min(steps_.size(), k + 2 * wide));
    }
    if (!is_smooth()) return {};
    std::vector<MissingFrames> all;
    for (std::size_t k = 1; k < steps_.size(); ++k)
      if (missing_[k] != 0) all.push_back({index_[k], missing_[k]});
    return all;
  }

 private:
  static constexpr double nothing = 1e-24;  ///< Variance of a path without errors.
  static constexpr double sure = 60.0;      ///< Of twice a log likelihood: the path's errors last for some frames.

  /// Where frames come by any clock of their own, their times say themselves what is missing.
  [[nodiscard]] bool has_period() {
    if (steps_.size() < 2 * narrow) return false;
    std::vector<double> gaps_s;
    for (std::size_t k = 1; k < steps_.size(); ++k) gaps_s.push_back(steps_[k]->t_s - steps_[k - 1]->t_s);
    period_s_ = median_of(gaps_s);
    constexpr double even = 0.05;
    const auto num_even = std::ranges::count_if(gaps_s, [&](double gap_s) {
      const double num = gap_s / period_s_;
      return std::abs(num - std::max(1.0, std::round(num))) < even;
    });
    return static_cast<std::size_t>(20 * num_even) >= 19 * gaps_s.size();
  }

  /// One of every few frames missing: around each of them others are, and none explains much alone.
  void suppose_every() {
    const std::vector<int> none(steps_.size(), 0);
    double best = sure;
    constexpr std::size_t rarest = 8;
    for (std::size_t every = 2; every <= rarest; ++every)
      for (std::size_t first = 1; first <= every; ++first) {
        std::vector<int> missing = none;
        for (std::size_t k = first; k < missing.size(); k += every) missing[k] = 1;
        double gain = 0.0;
        for (std::size_t from = 0; from + 2 * narrow <= steps_.size(); from += 2 * wide) {
          const Window window(*this, from, std::min(steps_.size(), from + 2 * wide));
          gain += window.gain(times_of(window, none), times_of(window, missing));
        }
        if (!(gain > best)) continue;
        best = gain;
        missing_ = std::move(missing);
      }
  }

  /// Whether poses are polynomials of the times that were found, as far as what is new from frame to frame lets them
  /// be: a step explains little of a motion that is none, as of whoever walks, and that at random.
  [[nodiscard]] bool is_smooth() const {
    constexpr double rough = 25.0, less = 0.7;
    std::array<std::vector<double>, 6> news;
    for (std::size_t k = 0; k + 4 <= steps_.size(); ++k) {
      const Window few(*this, k, k + 4);
      for (Eigen::Index c = 0; c < 6; ++c) news[static_cast<std::size_t>(c)].push_back(few.third_difference(c));
    }
    Eigen::Array<double, 6, 1> noise;
    for (Eigen::Index c = 0; c < 6; ++c) noise[c] = noise_of(news[static_cast<std::size_t>(c)]);
    const double found = roughness(missing_, noise);
    return found < rough || found < less * roughness(std::vector<int>(steps_.size(), 0), noise);
  }

  /// Variance about the polynomials over the noise, of most components in most places.
  [[nodiscard]] double roughness(const std::vector<int>& missing, const Eigen::Array<double, 6, 1>& noise) const {
    std::vector<double> ratios;
    for (std::size_t from = 0; from + 2 * narrow <= steps_.size(); from += wide / 2) {
      const Window window(*this, from, std::min(steps_.size(), from + 2 * wide));
      ratios.push_back((window.variance(times_of(window, missing)) / noise).log().mean());
    }
    return std::exp(median_of(std::move(ratios)));
  }

  /// Variance of one pose by third differences, as those are where no frame is missing: their lower quarter.
  [[nodiscard]] static double noise_of(std::vector<double> differences) {
    constexpr double of_variance = 20.0, quarter = 0.1015;  // 1 + 9 + 9 + 1; of χ² with one degree of freedom
    const auto at = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 4);
    for (double& each : differences) each *= each;
    std::nth_element(differences.begin(), at, differences.end());
    return *at / (of_variance * quarter) + nothing;
  }

  void look_again(std::size_t from, std::size_t to) {
    for (std::size_t k = std::max<std::size_t>(from, 1); k < to; ++k) best_[k] = best_at(k);
  }

  /// Of the step to frame k, as its neighbours are now. Both few frames and many have to speak for it: of few it
  /// explains only the error of one of them, of many only an acceleration.
  [[nodiscard]] LongerStep best_at(std::size_t k) const {
    LongerStep best;
    const auto try_all = [&](std::initializer_list<int> nums) {
      for (const int num : nums)
        if (const double gain = gain_of(k, num); gain > best.gain) best = {num, gain};
    };
    try_all({0, 1, 3, 8});
    if (!(best.gain > 0.2 * sure)) return {};
    for (int num = 1; num <= most_missing; ++num) try_all({num});
    return best;
  }

  [[nodiscard]] double gain_of(std::size_t k, int num) const {
    if (num == missing_[k]) return 0.0;
    const double of_few = gain_within(k, num, narrow), of_many = gain_within(k, num, wide);
    return std::min(of_few, of_many) > 0.0 ? std::max(of_few, of_many) : 0.0;
  }

  [[nodiscard]] double gain_within(std::size_t k, int num, std::size_t aside) const {
    const std::size_t first = k - std::min(k, aside), last = std::min(steps_.size(), k + aside);
    if (k - first < least_aside || last - k < least_aside) return 0.0;
    const Window window(*this, first, last);
    const Eigen::VectorXd times = times_of(window, missing_);
    Eigen::VectorXd longer = times;
    longer.tail(static_cast<Eigen::Index>(last - k)).array() += num - missing_[k];
    return window.gain(times, longer);
  }

  /// Poses of some frames in a row, from the middle one.
  class Window {
   public:
    Window(const PathTimes& path, std::size_t from, std::size_t to)
        : first(from), last(to), poses_(static_cast<Eigen::Index>(to - from), 6) {
      const Rigid3 middle_from_world = path.steps_[(from + to) / 2]->world_from_cam.inverse();
      for (std::size_t i = from; i < to; ++i) {
        const Rigid3 from_middle = middle_from_world * path.steps_[i]->world_from_cam;
        poses_.row(static_cast<Eigen::Index>(i - from)) << from_middle.translation.transpose(),
            log_so3(from_middle.rotation).transpose();
      }
    }
    [[nodiscard]] double gain(const Eigen::VectorXd& times, const Eigen::VectorXd& others) const {
      return static_cast<double>(poses_.rows() - order() - 1) * (left(times) / left(others)).log().sum();
    }
    [[nodiscard]] Eigen::Array<double, 6, 1> variance(const Eigen::VectorXd& times) const {
      return left(times) / static_cast<double>(poses_.rows() - order() - 1);
    }
    [[nodiscard]] double third_difference(Eigen::Index c) const {
      return poses_(3, c) - 3.0 * poses_(2, c) + 3.0 * poses_(1, c) - poses_(0, c);
    }
    std::size_t first, last;

   private:
    [[nodiscard]] Eigen::Index order() const { return std::max<Eigen::Index>(1, (poses_.rows() + 3) / 6); }
    /// Sums of squares of each component about its best polynomial of time.
    [[nodiscard]] Eigen::Array<double, 6, 1> left(const Eigen::VectorXd& times) const {
      const Eigen::Index num = times.size();
      const double middle = 0.5 * (times[0] + times[num - 1]);
      Eigen::MatrixXd powers(num, order() + 1);
      powers.col(0).setOnes();
      for (Eigen::Index i = 1; i <= order(); ++i)
        powers.col(i) = powers.col(i - 1).array() * (times.array() - middle) / (times[num - 1] - middle);
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(powers);
      Eigen::Matrix<double, Eigen::Dynamic, 6> turned = poses_;
      turned.applyOnTheLeft(qr.householderQ().adjoint());
      return turned.bottomRows(num - order() - 1).colwise().squaredNorm().transpose().array() + nothing;
    }
    Eigen::Matrix<double, Eigen::Dynamic, 6> poses_;
  };

  /// In periods, with what is missing before each.
  [[nodiscard]] Eigen::VectorXd times_of(const Window& window, const std::vector<int>& missing) const {
    Eigen::VectorXd times(static_cast<Eigen::Index>(window.last - window.first));
    int num = 0;
    for (std::size_t i = window.first; i < window.last; ++i) {
      num += i > window.first ? missing[i] : 0;
      times[static_cast<Eigen::Index>(i - window.first)] =
          (steps_[i]->t_s - steps_[window.first]->t_s) / period_s_ + num;
    }
    return times;
  }

  std::vector<const PathStep*> steps_;  ///< With a pose by their own observations,
  std::vector<std::size_t> index_;      ///< and which of the path they are.
  std::vector<int> missing_;            ///< Before each.
  std::vector<LongerStep> best_;
  double period_s_ = 0.0;
};

}  // namespace

std::vector<MissingFrames> missing_frames(std::span<const PathStep> path) { return PathTimes(path).found(); }

void add_missing(const Localization& report, Verdict& verdict) {
  if (report.missing.empty()) return;
  constexpr std::size_t most_named = 3;
  int num = 0;
  std::string where;
  for (std::size_t i = 0; i < report.missing.size(); ++i) {
    const MissingFrames& each = report.missing[i];
    num += each.num;
    if (i < most_named)
      where += (i == 0 ? " before frame " : ", ") + std::to_string(report.path[each.before].frame) + " (" +
               std::to_string(each.num) + ")";
  }
  if (report.missing.size() > most_named) where += " …";
  verdict.checks.push_back({"missing frames", State::care,
                            std::to_string(num) + (num == 1 ? " frame seems" : " frames seem") +
                                " to be missing:" + where +
                                " the camera comes as far at once as in several periods, and times say nothing of it: "
                                "those behind are too early",
                            static_cast<double>(num), 0.0, "1", "path"});
  verdict.to_add = "number the frames as they were taken, with the missing ones counted, or give each its time";
}

}  // namespace alidade
