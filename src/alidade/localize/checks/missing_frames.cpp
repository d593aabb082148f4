#include "alidade/localize/checks/missing_frames.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "alidade/estimation/median.h"
#include "alidade/localize/checks/frame_pattern.h"

namespace alidade {
namespace {

/// Neighbourhood of a step: number of frames, and order of the polynomial of time that models the poses.
struct Reach {
  std::size_t aside = 0;  ///< Frames on each side.
  Eigen::Index frames_a_power = 6;
  bool has_bend = false;  ///< The second and third derivative may jump at the step, as when a camera starts to move.
  [[nodiscard]] Eigen::Index order(Eigen::Index num_frames) const {
    return std::max<Eigen::Index>(1, (num_frames + 3) / frames_a_power);
  }
};
/// A walk is not polynomial over many frames; few frames do not contain one of its periods.
constexpr Reach few{5, 6, false}, some{8, 4, true}, many{16, 6, true};
constexpr std::size_t least_aside = 3;
constexpr int most_missing = 30;

/// A longer step, and twice its log likelihood ratio.
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

  void find() {
    if (!has_period()) return;
    suppose_pattern();
    const std::vector<int> by_pattern = missing_;
    look_again(0, steps_.size());
    const std::size_t most_changes = steps_.size();
    for (std::size_t i = 0; i < most_changes; ++i) {
      const auto best = std::ranges::max_element(best_, {}, &LongerStep::gain);
      if (!(best->gain > sure)) break;
      const auto k = static_cast<std::size_t>(best - best_.begin());
      missing_[k] = best->num;
      look_again(k - std::min(k, 2 * many.aside), std::min(steps_.size(), k + 2 * many.aside));
    }
    if (!is_smooth()) missing_ = by_pattern;
  }
  [[nodiscard]] std::vector<MissingFrames> found() const {
    std::vector<MissingFrames> all;
    for (std::size_t k = 1; k < steps_.size(); ++k)
      if (missing_[k] != 0) all.push_back({index_[k], missing_[k]});
    return all;
  }
  [[nodiscard]] const std::vector<int>& pattern() const { return pattern_; }

 private:
  static constexpr double nothing = 1e-24;  ///< Variance of an error-free path.
  static constexpr double sure = 45.0;      ///< Twice the log likelihood ratio; high, as path errors are correlated.

  /// If frames have no constant period, their times are taken as true.
  [[nodiscard]] bool has_period() {
    if (steps_.size() < 2 * few.aside) return false;
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

  /// Tries a regular pattern: around each missing frame others are missing, and none explains much alone.
  void suppose_pattern() {
    std::vector<NumberedPose> poses;
    for (std::size_t i = 0; i < steps_.size(); ++i)
      poses.push_back({index_[i], steps_[i]->t_s / period_s_, steps_[i]->world_from_cam});
    pattern_ = frame_pattern(poses);
    if (pattern_.empty()) return;
    for (std::size_t i = 1; i < steps_.size(); ++i) missing_[i] = pattern_[(index_[i] - 1) % pattern_.size()] - 1;
  }

  /// Whether poses are polynomials of the corrected times, as far as frame-to-frame noise allows: for a motion that is
  /// not, such as walking, a longer step explains little, and that by chance.
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

  /// Variance about the polynomials over the noise: mean over components (log), median over places.
  [[nodiscard]] double roughness(const std::vector<int>& missing, const Eigen::Array<double, 6, 1>& noise) const {
    std::vector<double> ratios;
    for (std::size_t from = 0; from + 2 * few.aside <= steps_.size(); from += some.aside) {
      const Window window(*this, from, std::min(steps_.size(), from + 2 * some.aside));
      ratios.push_back((window.variance(times_of(window, missing), some) / noise).log().mean());
    }
    return std::exp(median_of(std::move(ratios)));
  }

  /// Variance of one pose from third differences, of their lower quartile, where no frame is missing.
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

  /// Best change of the step to frame k, given its neighbours. Both `few` and `some` must support it: within few frames
  /// it may explain just the error of one of them, within some just an acceleration.
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
    const double of_few = gain_within(k, num, few), of_some = gain_within(k, num, some);
    return std::min(of_few, of_some) > 0.0 ? std::max({of_few, of_some, gain_within(k, num, many)}) : 0.0;
  }

  [[nodiscard]] double gain_within(std::size_t k, int num, const Reach& reach) const {
    const std::size_t first = k - std::min(k, reach.aside), last = std::min(steps_.size(), k + reach.aside);
    if (k - first < least_aside || last - k < least_aside) return 0.0;
    const Window window(*this, first, last);
    const Eigen::VectorXd times = times_of(window, missing_);
    Eigen::VectorXd longer = times;
    longer.tail(static_cast<Eigen::Index>(last - k)).array() += num - missing_[k];
    return window.gain(times, longer, reach, static_cast<Eigen::Index>(k - first) - 1);
  }

  /// Poses of consecutive frames, relative to the middle one.
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
    /// Twice the log likelihood ratio of other times, for the step after a frame.
    [[nodiscard]] double gain(const Eigen::VectorXd& times, const Eigen::VectorXd& others, const Reach& reach,
                              Eigen::Index after) const {
      const Eigen::MatrixXd one = terms(times, reach, after), other = terms(others, reach, after);
      return static_cast<double>(poses_.rows() - one.cols()) * (left(one) / left(other)).log().sum();
    }
    [[nodiscard]] Eigen::Array<double, 6, 1> variance(const Eigen::VectorXd& times, const Reach& reach) const {
      const Eigen::MatrixXd polynomial = terms(times, {reach.aside, reach.frames_a_power}, 0);
      return left(polynomial) / static_cast<double>(poses_.rows() - polynomial.cols());
    }
    [[nodiscard]] double third_difference(Eigen::Index c) const {
      return poses_(3, c) - 3.0 * poses_(2, c) + 3.0 * poses_(1, c) - poses_(0, c);
    }
    std::size_t first, last;

   private:
    /// Powers of time and, with a bend, those of the time after it.
    [[nodiscard]] static Eigen::MatrixXd terms(const Eigen::VectorXd& times, const Reach& reach, Eigen::Index bend) {
      const Eigen::Index num = times.size(), order = reach.order(num);
      const double middle = 0.5 * (times[0] + times[num - 1]), half = times[num - 1] - middle;
      Eigen::MatrixXd all = Eigen::MatrixXd::Ones(num, order + (reach.has_bend ? 3 : 1));
      for (Eigen::Index i = 1; i <= order; ++i) all.col(i) = all.col(i - 1).array() * (times.array() - middle) / half;
      if (reach.has_bend) {
        const Eigen::ArrayXd after = ((times.array() - times[bend]) / half).max(0.0);
        all.col(order + 1) = after.square();
        all.col(order + 2) = after.cube();
      }
      return all;
    }
    /// Sum of squared residuals of each component.
    [[nodiscard]] Eigen::Array<double, 6, 1> left(const Eigen::MatrixXd& terms) const {
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(terms);
      Eigen::Matrix<double, Eigen::Dynamic, 6> turned = poses_;
      turned.applyOnTheLeft(qr.householderQ().adjoint());
      return turned.bottomRows(poses_.rows() - terms.cols()).colwise().squaredNorm().transpose().array() + nothing;
    }
    Eigen::Matrix<double, Eigen::Dynamic, 6> poses_;
  };

  /// In periods, including the missing frames before each.
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

  std::vector<const PathStep*> steps_;  ///< Frames with a pose from their own observations,
  std::vector<std::size_t> index_;      ///< and their indices in the path.
  std::vector<int> missing_;            ///< Missing frames before each.
  std::vector<int> pattern_;            ///< Repeating steps in periods; empty: none.
  std::vector<LongerStep> best_;
  double period_s_ = 0.0;
};

/// The first few places, with the number of missing frames.
std::string places_text(const Localization& report) {
  constexpr std::size_t most_named = 3;
  std::string where;
  for (std::size_t i = 0; i < std::min(most_named, report.missing.size()); ++i)
    where += (i == 0 ? " before frame " : ", ") + std::to_string(report.path[report.missing[i].before].frame) + " (" +
             std::to_string(report.missing[i].num) + ")";
  return report.missing.size() > most_named ? where + " …" : where;
}

std::string pattern_text(std::span<const int> pattern) {
  std::string steps;
  for (const int step : pattern) steps += (steps.empty() ? "" : ", ") + std::to_string(step);
  return " in a regular pattern: frames are " + steps + " periods apart, again and again;";
}

}  // namespace

FoundMissing missing_frames(std::span<const PathStep> path) {
  PathTimes times(path);
  times.find();
  return {times.found(), times.pattern()};
}

void add_missing(const Localization& report, Verdict& verdict) {
  if (report.missing.empty()) return;
  int num = 0;
  for (const MissingFrames& each : report.missing) num += each.num;
  const bool is_pattern = !report.frame_pattern.empty();
  verdict.checks.push_back(
      {"missing frames", State::care,
       std::to_string(num) + (num == 1 ? " frame seems" : " frames seem") + " to be missing" +
           (is_pattern ? pattern_text(report.frame_pattern) : ":" + places_text(report)) +
           " the camera comes as far at once as in several periods, and times say nothing of it: " +
           (is_pattern ? "they are not those of the frames" : "those behind are too early"),
       static_cast<double>(num), 0.0, "1", "path"});
  verdict.to_add = "number the frames as they were taken, with the missing ones counted, or give each its time";
}

}  // namespace alidade
