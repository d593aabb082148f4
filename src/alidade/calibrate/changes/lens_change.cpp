#include "alidade/calibrate/changes/lens_change.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <string_view>
#include <utility>

#include "alidade/calibrate/study.h"
#include "alidade/estimation/innovation.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t min_views = 6;
constexpr std::string_view focal_length = LensChange::focal_length;
using Profile = LensChange::Profile;
/// What of a change of the focal length may be chance, in σ: one clean set in 20 drifts by more, and one in 50 jumps
/// somewhere. With the distance it costs more: far points are off by more than any photo. What is beyond is included
/// in σ: where it is proved the first photo is off by 5σ already.
double chance_sigmas(Profile profile) {
  return profile == Profile::drift ? 2.0 : profile == Profile::distance ? 2.5 : 3.5;
}

/// What could change, as a direction in the lens parameters, and what each view says of it: its score γ, its
/// information α and what of that the estimated parameters share, b, in units in which their information is 1.
struct Direction {
  std::string what;
  VectorXd of_lens;
  VectorXd score, information;
  MatrixXd shared;    ///< A column a view.
  VectorXd nearness;  ///< Of the boards, 0 of the farthest and 1 of the nearest: 1/z over its range.
};

/// The views' part of the estimated parameters.
struct Estimated {
  LensSplit split;
  MatrixXd whiten;      ///< M, M Mᵀ = H⁻¹
  MatrixXd scores;      ///< Mᵀ g, a column a view, at the optimum.
  VectorXd to_optimum;  ///< −H⁻¹ Σ g: rejection and weights of the solve leave the scores' sum a little beside zero.
};

std::optional<Estimated> estimated_of(std::span<const ViewScore> views, const CalibrateReport& report) {
  Estimated all{split_of(report), {}, {}, {}};
  const auto& free = all.split.free;
  const auto num = static_cast<Index>(free.size());
  MatrixXd H = MatrixXd::Zero(num, num);
  VectorXd sum = VectorXd::Zero(num);
  for (const ViewScore& view : views) {
    H += view.information(free, free);
    sum += view.gradient(free);
  }
  const VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Llt llt(scaled_by(scale, H));
  if (num == 0 || !llt.is_positive() || !scale.allFinite()) return std::nullopt;
  all.whiten = scale.asDiagonal() * llt.whitened(MatrixXd::Identity(num, num)).transpose();
  all.to_optimum = -(all.whiten * (all.whiten.transpose() * sum));
  all.scores.resize(num, static_cast<Index>(views.size()));
  for (std::size_t k = 0; k < views.size(); ++k)
    all.scores.col(static_cast<Index>(k)) =
        all.whiten.transpose() * (views[k].gradient(free) + views[k].information(free, free) * all.to_optimum);
  return all;
}

Direction direction_of(const std::string& what, VectorXd of_lens, std::span<const ViewScore> views,
                       const Estimated& all) {
  const auto num_views = static_cast<Index>(views.size());
  Direction direction{what,
                      std::move(of_lens),
                      VectorXd(num_views),
                      VectorXd(num_views),
                      MatrixXd(all.whiten.cols(), num_views),
                      VectorXd(num_views)};
  for (Index k = 0; k < num_views; ++k) {
    const ViewScore& view = views[static_cast<std::size_t>(k)];
    direction.nearness[k] = 1.0 / view.depth_m;
    const VectorXd by_lens = view.information * direction.of_lens;
    direction.information[k] = direction.of_lens.dot(by_lens);
    direction.score[k] = direction.of_lens.dot(view.gradient) + by_lens(all.split.free).dot(all.to_optimum);
    direction.shared.col(k) = all.whiten.transpose() * by_lens(all.split.free);
  }
  const double range = direction.nearness.maxCoeff() - direction.nearness.minCoeff();
  direction.nearness = ((direction.nearness.array() - direction.nearness.minCoeff()) / range).eval();
  return direction;
}

/// Focal length, cx and cy: what moves with temperature, focus or a bump.
std::vector<Direction> directions_of(std::span<const ViewScore> views, const CalibrateReport& report,
                                     const Estimated& all) {
  const VectorXd lens = params(report.camera.lens);
  const auto unit = [&](Index at, double value) {
    VectorXd direction = VectorXd::Zero(lens.size());
    direction[at] = value;
    return direction;
  };
  return {direction_of(std::string(focal_length), unit(0, lens[0]) + unit(1, lens[1]), views, all),
          direction_of("cx", unit(2, 1.0), views, all), direction_of("cy", unit(3, 1.0), views, all)};
}

/// Sums over the photos' profile t: Σ t γ, Σ t² α, Σ t α and Σ t b.
struct Sums {
  double score = 0.0, squares = 0.0, information = 0.0;
  VectorXd shared;

  void add(const Direction& direction, Index view, double t) {
    score += t * direction.score[view];
    squares += t * t * direction.information[view];
    information += t * direction.information[view];
    shared += t * direction.shared.col(view);
  }
};

/// Score of a profile about its mean, and its information once the estimated parameters follow.
struct ProfileScore {
  double score = 0.0, information = 0.0, mean = 0.0;

  [[nodiscard]] double chi2() const { return information > 0.0 ? score * score / information : 0.0; }
};

ProfileScore score_of(const Direction& direction, const Sums& sums, const Sums& total) {
  ProfileScore of{.mean = sums.information / total.information};
  of.score = sums.score - of.mean * total.score;
  const double whole = sums.squares - of.mean * sums.information;
  of.information = whole - (sums.shared - of.mean * total.shared).squaredNorm();
  constexpr double nothing_left = 1e-9;  // of it: the profile is what the estimated parameters do
  if (!(of.information > nothing_left * direction.information.sum())) of.information = 0.0;
  return of;
}

/// A profile of one direction over the photos, and how much of the residuals it explains.
struct Found {
  const Direction* direction = nullptr;
  Profile profile = Profile::drift;
  std::size_t at = 0;
  double chi2 = 0.0;  ///< Of residuals in pixels.
};

/// At least so many views on either side of a jump: fewer are outliers, whatever comes after them.
std::size_t least_beside(std::size_t num_views) { return std::max<std::size_t>(3, num_views / 8); }

double drift_at(std::size_t place, std::size_t num_views) {
  return static_cast<double>(place) / static_cast<double>(num_views - 1);
}

/// The drift, the course with the distance, or the jump that explains most, the views standing in that order.
Found best_profile(const Direction& direction, Profile profile, const std::vector<Index>& order) {
  const std::size_t n = order.size(), least = least_beside(n), stride = 1 + n / 60;
  const Sums none{.shared = VectorXd::Zero(direction.shared.rows())};
  Sums total = none, sums = none;
  for (std::size_t i = 0; i < n; ++i) {
    total.add(direction, order[i], 1.0);
    if (profile == Profile::drift) sums.add(direction, order[i], drift_at(i, n));
    if (profile == Profile::distance) sums.add(direction, order[i], direction.nearness[static_cast<Index>(i)]);
  }
  Found best{&direction, profile};
  if (!(total.information > 0.0)) return best;
  if (profile != Profile::jump) best.chi2 = score_of(direction, sums, total).chi2();
  for (std::size_t i = n; profile == Profile::jump && i-- > least;) {
    sums.add(direction, order[i], 1.0);
    if (n - i < least || i % stride != 0) continue;
    const double chi2 = score_of(direction, sums, total).chi2();
    if (chi2 > best.chi2) best = {&direction, profile, i, chi2};
  }
  return best;
}

/// Whether hardly any other order of the views, one in fifty, shows as much. It stops as soon as too many do.
bool is_of_the_order(const Found& found, std::vector<Index> order) {
  constexpr int orders = 499, at_most = 9;
  constexpr double alike = 1.0 - 1e-9;  // the reverse order shows the same
  std::mt19937_64 bits(1);
  int as_large = 0;
  for (int trial = 0; trial < orders && as_large <= at_most; ++trial) {
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[bits() % i]);
    as_large += best_profile(*found.direction, found.profile, order).chi2 >= alike * found.chi2 ? 1 : 0;
  }
  return as_large <= at_most;
}

/// The profiles' values, view by view, about their mean.
VectorXd values_of(const Found& found, Index num_views) {
  VectorXd t = found.direction->nearness;
  for (Index k = 0; found.profile != Profile::distance && k < num_views; ++k) {
    const auto place = static_cast<std::size_t>(k);
    t[k] = found.profile == Profile::drift ? drift_at(place, static_cast<std::size_t>(num_views))
                                           : (place >= found.at ? 1.0 : 0.0);
  }
  const VectorXd& information = found.direction->information;
  return t.array() - t.dot(information) / information.sum();
}

/// σ of the size by what remains of the views' scores beside it.
double sigma_of(const VectorXd& t, const Found& found, const Estimated& all, double size, double information) {
  const Direction& direction = *found.direction;
  const VectorXd shared = direction.shared * t;
  const auto n = static_cast<double>(t.size());
  double sum = 0.0;
  for (Index k = 0; k < t.size(); ++k) {
    const double own = t[k] * direction.score[k] - shared.dot(all.scores.col(k));
    const double fitted = size * (t[k] * t[k] * direction.information[k] - t[k] * shared.dot(direction.shared.col(k)));
    sum += (own + fitted) * (own + fitted);
  }
  return std::sqrt(sum * n / (n - 2.0)) / information;
}

/// Its information once the estimated parameters follow.
double information_of(const VectorXd& t, const Direction& direction) {
  return (t.array().square() * direction.information.array()).sum() - (direction.shared * t).squaredNorm();
}

/// From how many σ on it is no chance: by these one clean set in 350 drifts, and one in 500 jumps somewhere. The focal
/// length is what drifts most, and matters most.
double proved_from(const Found& found) {
  if (found.profile == Profile::jump) return 4.0;
  if (found.profile == Profile::distance) return 3.5;  // of what a lens or a board is otherwise, distances show much
  return found.direction->what == focal_length ? 3.1 : 3.5;
}

/// The size of a drift that is proved in 99 of 100 sets. In other orders of the photos a drift of z σ scatters by
/// √(1 + h z²) σ: h is large where few photos determine it. None where no drift would stand out of the orders.
std::optional<double> size_seen(const Found& drift, double sigma) {
  const Direction& direction = *drift.direction;
  const VectorXd t = values_of(drift, direction.score.size());
  const VectorXd score = direction.information.cwiseProduct(t) - direction.shared.transpose() * (direction.shared * t);
  const auto centred_square = [](const VectorXd& v) { return (v.array() - v.mean()).square().sum(); };
  const double information = information_of(t, direction);
  const double h =
      centred_square(t) * centred_square(score) / (static_cast<double>(t.size() - 1) * information * information);
  constexpr double at_99 = 2.33, of_fifty = 2.33;     // of a normal deviate: one-sided 99 %, two-sided 98 %
  const double left = 1.0 - of_fifty * of_fifty * h;  // of z − 2.33 ≥ 2.33 √(1 + h z²)
  constexpr double least_left = 0.2;
  if (left < least_left) return std::nullopt;
  return sigma * std::max(proved_from(drift) + at_99, (at_99 + of_fifty) / left);
}

LensChange change_of(const Found& found, const Estimated& all, const CalibrateReport& report) {
  const Direction& direction = *found.direction;
  const VectorXd t = values_of(found, direction.score.size());
  const double information = information_of(t, direction);
  LensChange change{.profile = found.profile, .what = direction.what, .at = found.at, .direction = direction.of_lens};
  change.size = -t.dot(direction.score) / information;
  const double by_noise = report.noise_px / std::sqrt(information),
               by_scatter = sigma_of(t, found, all, change.size, information);
  change.sigma = std::max(by_noise, by_scatter);
  const double chance = chance_sigmas(found.profile);
  const double by_chance =
      std::max(chance * by_noise, students(chance, static_cast<double>(t.size()) - 2.0) * by_scatter);
  change.share_beyond_chance = std::max(0.0, 1.0 - std::pow(by_chance / change.size, 2));
  change.mean_square = change.size * change.size * t.squaredNorm() / static_cast<double>(t.size());
  change.course.assign(t.begin(), t.end());
  for (const Index at : all.split.free) {
    const double sigma = std::sqrt(report.camera.cov(at, at));
    const double moved = std::abs(change.size * direction.of_lens[at]) * t.cwiseAbs().maxCoeff();
    change.moves = std::max(change.moves, moved / sigma);
  }
  return change;
}

}  // namespace

namespace {

/// What a course with the distance says of far points, whose lens is asked for most.
void extend_to_far_points(std::span<const ViewScore> views, const Direction& direction, LensChange& change) {
  const auto [nearest, farthest] = std::ranges::minmax(views, {}, &ViewScore::depth_m);
  change.nearest_m = nearest.depth_m;
  change.farthest_m = farthest.depth_m;
  const double of_farthest = 1.0 / farthest.depth_m, range = 1.0 / nearest.depth_m - of_farthest;
  const double mean = direction.nearness.dot(direction.information) / direction.information.sum();
  change.mean_square = std::pow(change.size * (of_farthest / range + mean), 2);
}

}  // namespace

LensChangeStudy lens_change(std::span<const ViewScore> views, const CalibrateReport& report) {
  LensChangeStudy study;
  const std::optional<Estimated> all = views.size() < min_views ? std::nullopt : estimated_of(views, report);
  if (!all) return study;
  const std::vector<Direction> directions = directions_of(views, report, *all);
  std::vector<Index> order(views.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::vector<std::pair<double, LensChange>> found_changes;  // by weight
  for (const Direction& direction : directions) {
    for (const Profile profile : {Profile::drift, Profile::jump, Profile::distance}) {
      const Found found = best_profile(direction, profile, order);
      if (!(found.chi2 > 0.0)) continue;
      LensChange change = change_of(found, *all, report);
      const bool is_focal = direction.what == focal_length;
      if (profile == Profile::distance) {
        if (!is_focal) continue;
        extend_to_far_points(views, direction, change);
      }
      if (is_focal && profile == Profile::drift) study.seen_from = size_seen(found, change.sigma);
      if (profile == Profile::distance) study.seen_by_distance = size_seen(found, change.sigma);
      const double most = 0.05 * (is_focal ? 1.0 : report.camera.width_px);
      if (std::abs(change.size) > most) continue;  // no lens does: another camera, or what is not modelled
      const double sigmas = std::abs(change.size) / change.sigma;
      change.is_proved = sigmas > proved_from(found) && is_of_the_order(found, order);
      // What warming up or a creeping focus comes to, and what focusing does.
      const double most_unproved = profile == Profile::distance ? most : 0.01;
      const bool is_included = is_focal && change.share_beyond_chance > 0.0 && std::abs(change.size) < most_unproved;
      if (!change.is_proved) change.mean_square *= change.share_beyond_chance;
      // A proved one goes before one that is only included.
      const double weight = sigmas * (change.is_proved ? 100.0 : is_included ? 1.0 : 0.0);
      if (weight > 0.0) found_changes.emplace_back(weight, std::move(change));
    }
  }
  std::ranges::stable_sort(found_changes, std::ranges::greater{}, [](const auto& found) { return found.first; });
  for (auto& [weight, change] : found_changes) {
    if (study.change)
      study.rivals.push_back(std::move(change));
    else
      study.change = std::move(change);
  }
  return study;
}

CalibrateConfig with_distortion_fixed(CalibrateConfig config, const CalibrateReport& report) {
  const std::vector<std::string> names = param_names(report.camera.lens);
  const VectorXd values = params(report.camera.lens);
  for (std::size_t i = 4; i < names.size(); ++i) {
    std::erase_if(config.priors, [&](const Prior& prior) { return prior.name == names[i]; });
    std::erase(config.fixed, names[i]);
    std::erase(config.free, names[i]);
    config.fixed.push_back(names[i]);
    config.priors.push_back({.name = names[i], .value = values[static_cast<Index>(i)]});
  }
  config.board_shape = BoardShape::given;
  return config;
}

bool is_confirmed(const LensChange& change, const Board& board, std::span<const BoardView> used,
                  const CalibrateConfig& config, const CalibrateReport& report) {
  if (!is_central(report.camera.lens)) return true;
  const CalibrateConfig simple = with_distortion_fixed(config, report);
  std::vector<std::size_t> order(used.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (change.profile == Profile::distance)
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return change.course[k]; });
  const std::size_t at = change.profile == Profile::jump ? change.at : used.size() / 2;
  std::vector<BoardView> in_order;
  double share_before = 0.0, share_after = 0.0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    in_order.push_back(used[order[i]]);
    const bool is_before = i < at;
    (is_before ? share_before : share_after) +=
        change.course[order[i]] / static_cast<double>(is_before ? at : order.size() - at);
  }
  const std::span<const BoardView> views(in_order);
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  const CalibrateReport before = calibrate(board, views.first(at), size, simple, report.board_points),
                        after = calibrate(board, views.subspan(at), size, simple, report.board_points);
  if (before.status != CalibrateReport::Status::converged || after.status != before.status) return false;
  Index param = 0;
  change.direction.cwiseAbs().maxCoeff(&param);
  const double share = change.direction[param] * (share_after - share_before), expected = share * change.size;
  const double found = params(after.camera.lens)[param] - params(before.camera.lens)[param];
  const double variance =
      share * share * change.sigma * change.sigma + before.camera.cov(param, param) + after.camera.cov(param, param);
  constexpr double sigmas = 3.0;
  return (found - expected) * (found - expected) <= sigmas * sigmas * variance;
}

void count_change(const LensChange& change, CalibrateReport& report) {
  VectorXd direction = change.direction;
  for (const Index at : split_of(report).fixed) direction[at] = 0.0;
  report.camera.cov += change.mean_square * direction * direction.transpose();
}

}  // namespace alidade
