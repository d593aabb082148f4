#include "alidade/calibrate/changes/two_lenses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "alidade/board/board_pose.h"
#include "alidade/calibrate/changes/lens_change.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t fewest_views = 10, min_beside = 3;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// What each view says of a change of the lens along a direction, alone and to first order, and how surely.
struct Readings {
  VectorXd values, weights;
};

Readings readings_of(std::span<const ViewScore> scores, const VectorXd& direction) {
  const auto n = static_cast<Index>(scores.size());
  Readings readings{VectorXd::Zero(n), VectorXd::Zero(n)};
  for (Index k = 0; k < n; ++k) {
    const ViewScore& view = scores[static_cast<std::size_t>(k)];
    readings.weights[k] = direction.dot(view.information * direction);
    if (readings.weights[k] > 0.0) readings.values[k] = -direction.dot(view.gradient) / readings.weights[k];
  }
  return readings;
}

/// True for those above the place that divides them into two with the least scatter in each.
std::vector<bool> divided(const Readings& readings) {
  const auto n = static_cast<std::size_t>(readings.values.size());
  std::vector<Index> order(n);
  std::iota(order.begin(), order.end(), Index{0});
  std::ranges::sort(order, {}, [&](Index k) { return readings.values[k]; });
  const double weight = readings.weights.sum(), sum = readings.values.dot(readings.weights);
  double below_weight = 0.0, below_sum = 0.0, best = -infinity;
  std::size_t at = n / 2;
  for (std::size_t i = 0; i + min_beside < n; ++i) {
    below_weight += readings.weights[order[i]];
    below_sum += readings.weights[order[i]] * readings.values[order[i]];
    if (i + 1 < min_beside || !(below_weight > 0.0) || !(weight > below_weight)) continue;
    const double above_sum = sum - below_sum;
    const double between = below_sum * below_sum / below_weight + above_sum * above_sum / (weight - below_weight);
    if (between > best) best = between, at = i + 1;
  }
  std::vector<bool> above(n, false);
  for (std::size_t i = at; i < n; ++i) above[static_cast<std::size_t>(order[i])] = true;
  return above;
}

/// Sum of squares of the view's corners [px²], in the pose in which they fit the lens best.
double misfit_of(const Camera& camera, const BoardView& view, std::span<const Eigen::Vector3d> points) {
  const auto fit = fit_board_pose(camera, view, points, 1.0);
  return fit ? fit->chi2 : infinity;
}

struct Division {
  std::vector<bool> is_second;
  CalibrateReport first, second;  ///< The first has more views.
};

std::vector<BoardView> part_of(std::span<const BoardView> views, const std::vector<bool>& is_second, bool second) {
  std::vector<BoardView> part;
  for (std::size_t k = 0; k < views.size(); ++k)
    if (is_second[k] == second) part.push_back(views[k]);
  return part;
}

/// A few views leave the distortion to the many, but for its first term: another camera has its own.
CalibrateConfig for_few_views(const CalibrateConfig& config, const CalibrateReport& many) {
  CalibrateConfig few = with_distortion_fixed(config, many);
  if (std::ranges::find(config.fixed, "k1") != config.fixed.end()) return few;
  std::erase(few.fixed, "k1");
  std::erase_if(few.priors, [](const Prior& prior) { return prior.name == "k1"; });
  return few;
}

/// Both parts calibrated by themselves.
std::optional<Division> calibrated(const Board& board, std::span<const BoardView> views,
                                   const std::vector<bool>& is_second, const CalibrateConfig& config,
                                   const CalibrateReport& report) {
  constexpr std::size_t few = 6;
  std::vector<BoardView> many = part_of(views, is_second, false), others = part_of(views, is_second, true);
  const bool second_has_more = others.size() > many.size();
  if (second_has_more) many.swap(others);
  if (others.size() < min_beside) return std::nullopt;
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  Division division{is_second, calibrate(board, many, size, config, report.board_points), {}};
  if (division.first.status != CalibrateReport::Status::converged) return std::nullopt;
  division.second = calibrate(board, others, size, others.size() < few ? for_few_views(config, division.first) : config,
                              report.board_points);
  if (division.second.status != CalibrateReport::Status::converged) return std::nullopt;
  if (second_has_more) division.is_second.flip();
  return division;
}

bool suits_second(const Division& division, const BoardView& view, std::span<const Eigen::Vector3d> points) {
  return misfit_of(division.second.camera, view, points) < misfit_of(division.first.camera, view, points);
}

std::optional<Division> settled(const Board& board, std::span<const BoardView> views, std::vector<bool> is_second,
                                const CalibrateConfig& config, const CalibrateReport& report) {
  constexpr int rounds = 8;
  for (int round = 0; round < rounds; ++round) {
    std::optional<Division> division = calibrated(board, views, is_second, config, report);
    if (!division) return std::nullopt;
    for (std::size_t k = 0; k < views.size(); ++k)
      is_second[k] = suits_second(*division, views[k], report.board_points);
    if (is_second == division->is_second) return division;
  }
  return std::nullopt;
}

/// What a corner's error is worth in each part, where photos share theirs.
double shared_noise_px(const Division& division) {
  const auto seconds = static_cast<double>(std::ranges::count(division.is_second, true));
  const double share = seconds / static_cast<double>(division.is_second.size());
  return std::hypot(std::sqrt(1.0 - share) * alidade::shared_noise_px(division.first),
                    std::sqrt(share) * alidade::shared_noise_px(division.second));
}

/// Whether the lenses differ, beyond what ordering the views by one of its parameters makes of chance.
bool differ(const Camera& a, const Camera& b) {
  constexpr double sigmas = 10.0;
  const VectorXd difference = params(a.lens) - params(b.lens);
  for (Index at = 0; at < 4; ++at) {
    const double variance = a.cov(at, at) + b.cov(at, at);
    if (difference[at] * difference[at] > sigmas * sigmas * variance) return true;
  }
  return false;
}

}  // namespace

std::vector<bool> divided_along(std::span<const ViewScore> scores, const VectorXd& direction) {
  return divided(readings_of(scores, direction));
}

std::optional<TwoLenses> two_lenses(const Board& board, std::span<const BoardView> views,
                                    std::span<const ViewScore> scores, CalibrateConfig config,
                                    const CalibrateReport& report) {
  constexpr std::size_t most = 120;
  if (views.size() < fewest_views || scores.size() != views.size() || !is_central(report.camera.lens))
    return std::nullopt;
  config.board_shape = BoardShape::given;
  const std::size_t stride = 1 + (views.size() - 1) / most;
  std::vector<BoardView> some;
  std::vector<ViewScore> scores_of_some;
  for (std::size_t k = 0; k < views.size(); k += stride) {
    some.push_back(views[k]);
    scores_of_some.push_back(scores[k]);
  }
  const VectorXd lens = params(report.camera.lens);
  std::optional<Division> best;
  for (Index at = 0; at < 3; ++at) {  // focal length, cx, cy
    VectorXd direction = VectorXd::Zero(lens.size());
    if (at == 0) direction.head<2>() = lens.head<2>();
    if (at > 0) direction[at + 1] = 1.0;
    auto found = settled(board, some, divided_along(scores_of_some, direction), config, report);
    if (found && (!best || shared_noise_px(*found) < shared_noise_px(*best))) best = std::move(found);
  }
  constexpr double far_less = 0.4;  // a lens that drifts evenly, divided in the middle: 0.5
  const double together_px = shared_noise_px(report);
  if (!best || shared_noise_px(*best) > far_less * together_px) return std::nullopt;
  if (!differ(best->first.camera, best->second.camera)) return std::nullopt;
  TwoLenses found{best->first.camera, best->second.camera, {}, shared_noise_px(*best), together_px};
  for (std::size_t k = 0; k < views.size(); ++k)
    if (suits_second(*best, views[k], report.board_points)) found.seconds.push_back(k);
  return found;
}

void heed_two_lenses(const TwoLenses& found, std::span<const std::string> photos, Verdict& verdict) {
  constexpr std::size_t named = 4;
  std::string names;
  for (std::size_t i = 0; i < std::min(named, found.seconds.size()); ++i)
    names += (i == 0 ? "" : ", ") + photos[found.seconds[i]];
  if (found.seconds.size() > named) names += ", …";
  const auto fx_px = [](const Camera& camera) { return params(camera.lens)[0]; };
  Check check{.name = "two lenses", .state = State::bad, .unit = "1", .figure = "photos"};
  check.value = found.together_px / found.apart_px;
  check.limit = 2.5;
  check.text = fmt::format(
      "the photos are of two lenses: {} of {} ({}) fit one with fx {:.5g} px, the others one with {:.5g} px; photos "
      "disagree {:.2g} times less with each its own",
      found.seconds.size(), photos.size(), names, fx_px(found.second), fx_px(found.first), check.value);
  verdict.checks.push_back(check);
  verdict.state = std::max(verdict.state, State::bad);
  verdict.exit_code = ExitCode::not_trusted;
  verdict.sentence = "Not to be trusted: " + check.text;
  verdict.to_add =
      "calibrate the two apart: photos of another camera, zoom or focus, or photos that were cropped or scaled, are "
      "among them";
}

}  // namespace alidade
