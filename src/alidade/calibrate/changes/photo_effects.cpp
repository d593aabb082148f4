#include "alidade/calibrate/changes/photo_effects.h"
#include "alidade/geometry/decompositions.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t min_photos = 8;

/// The views' scores by the parameters that were estimated, the focal lengths as one, at the optimum.
struct Scores {
  std::vector<MatrixXd> information;
  std::vector<VectorXd> gradient;
};

/// Columns: the focal length, cx, cy, and the other free parameters.
MatrixXd parameters_of(const CalibrateReport& report, const LensSplit& split) {
  const VectorXd lens = params(report.camera.lens);
  MatrixXd columns = MatrixXd::Zero(lens.size(), 3);
  columns(0, 0) = lens[0];
  columns(1, 0) = lens[1];
  columns(2, 1) = columns(3, 2) = 1.0;
  for (const Index at : split.free) {
    if (at < 4) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.col(columns.cols() - 1) = VectorXd::Unit(lens.size(), at);
  }
  return columns;
}

Scores scores_of(std::span<const ViewScore> views, const MatrixXd& columns) {
  Scores scores;
  MatrixXd sum = MatrixXd::Zero(columns.cols(), columns.cols());
  VectorXd rest = VectorXd::Zero(columns.cols());
  for (const ViewScore& view : views) {
    scores.information.emplace_back(columns.transpose() * view.information * columns);
    scores.gradient.emplace_back(columns.transpose() * view.gradient);
    sum += scores.information.back();
    rest += scores.gradient.back();
  }
  const VectorXd to_optimum = -solve_symmetric(sum, rest);
  for (std::size_t k = 0; k < views.size(); ++k) scores.gradient[k] += scores.information[k] * to_optimum;
  return scores;
}

/// gᵀ I⁺ g over its dimensions, those left out that the view hardly determines.
struct Square {
  double sum = 0.0;
  int dimensions = 0;
};

Square square_of(const MatrixXd& information, const VectorXd& gradient) {
  const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const SymmetricEigen eigen = symmetric_eigen(scaled_by(scale, information));
  const VectorXd along = eigen.vectors.transpose() * scale.cwiseProduct(gradient);
  Square square;
  constexpr double determined = 1e-7;
  for (Index i = 0; i < along.size(); ++i) {
    if (eigen.values[i] < determined) continue;
    square.sum += along[i] * along[i] / eigen.values[i];
    ++square.dimensions;
  }
  return square;
}

/// Mean square of the scores of the parameters from `first` on, once each view has its own of the `num` ones before.
double left_over(const Scores& scores, const std::vector<Index>& own, const std::vector<Index>& others,
                 double noise_px) {
  Square total;
  for (std::size_t k = 0; k < scores.gradient.size(); ++k) {
    const MatrixXd& I = scores.information[k];
    const VectorXd& g = scores.gradient[k];
    MatrixXd left = I(others, others);
    VectorXd score = g(others);
    if (!own.empty()) {
      const MatrixXd follow = Ldlt(MatrixXd(I(own, own))).solve_each(MatrixXd(I(own, others)));
      left -= I(others, own) * follow;
      score -= follow.transpose() * g(own);
    }
    const Square square = square_of(left, score);
    total.sum += square.sum;
    total.dimensions += square.dimensions;
  }
  return total.sum / (noise_px * noise_px * total.dimensions);
}

/// σ over the views of these parameters, by how much their scores scatter beyond the noise (moments).
double scatter_of(const Scores& scores, const std::vector<Index>& own, double noise_px) {
  double beyond = 0.0, squares = 0.0;
  for (std::size_t k = 0; k < scores.gradient.size(); ++k) {
    const MatrixXd I = scores.information[k](own, own);
    beyond += scores.gradient[k](own).squaredNorm() - noise_px * noise_px * I.trace();
    squares += I.squaredNorm();
  }
  return std::sqrt(std::max(0.0, beyond / squares));
}

}  // namespace

std::optional<PhotoEffect> photo_effect(std::span<const ViewScore> views, const CalibrateReport& report) {
  if (views.size() < min_photos) return std::nullopt;
  const MatrixXd columns = parameters_of(report, split_of(report));
  const Scores scores = scores_of(views, columns);
  const auto left_with = [&](const std::vector<Index>& own) {
    std::vector<Index> others;
    for (Index i = 0; i < columns.cols(); ++i)
      if (std::ranges::find(own, i) == own.end()) others.push_back(i);
    return left_over(scores, own, others, report.noise_px);
  };
  const std::vector<Index> focal{0}, centre{1, 2};
  const double before = left_with({}), by_focal = left_with(focal), by_centre = left_with(centre);
  const double sigma = std::sqrt(2.0 / static_cast<double>(views.size() * static_cast<std::size_t>(columns.cols())));
  constexpr double disagree = 1.4, sigmas = 5.0, explains = 0.3, clearly = 0.25;
  const bool is_centre = by_centre < by_focal;
  const double beyond = before - 1.0, after = std::min(by_focal, by_centre);
  if (before < disagree || beyond < sigmas * sigma || after - 1.0 > explains * beyond) return std::nullopt;
  if (std::abs(by_focal - by_centre) < clearly * beyond) return std::nullopt;
  return PhotoEffect{is_centre, scatter_of(scores, is_centre ? centre : focal, report.noise_px), before, after};
}

void heed_photo_effect(const PhotoEffect& effect, Verdict& verdict) {
  Check check{.name = "photo to photo", .state = State::care, .value = effect.before, .limit = 1.4, .unit = "1"};
  check.figure = "photos";
  check.text = effect.is_centre
                   ? "the centre differs from photo to photo, by about " + text_of(effect.scatter, 2) +
                         " px, as with an image stabiliser: with one for each photo they agree"
                   : "the focal length differs from photo to photo, by about " + text_of(100.0 * effect.scatter, 2) +
                         " %, in no order, as where an autofocus is on: with one for each photo they agree";
  const std::string remedy =
      effect.is_centre ? "switch the image stabilisation of lens and camera off and take the photos again, or expect "
                         "this of each photo"
                       : "switch the autofocus off, fix the focus for the distances at which the camera is used, and "
                         "take the photos again";
  const bool was_good = verdict.state == State::good;
  heed(check, remedy, verdict);
  if (!was_good) verdict.sentence += "; " + check.text;
  verdict.to_add = remedy;
}

}  // namespace alidade
