#include "alidade/corners/corner_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <utility>

#include "alidade/corners/blurred_edge.h"
#include "alidade/corners/corner_window.h"
#include "alidade/geometry/vector_clones.h"

namespace alidade {
namespace {

constexpr double min_blur_px = 0.4, max_blur_px = 4.0;  // a pixel's own width blurs by 0.29; sharper edges make jumps
constexpr double min_pixels = 16.0;                     // more than twice the parameters
constexpr double converged_px = 1e-3;                   // the next step would be ten times smaller
constexpr double min_sin_angle = 0.10;                  // 6°: beyond it the two edges are one
constexpr double max_sigma_px = 0.5;                    // a corner less certain than that is none

constexpr double edge_reach = 3.6;  // blurs from an edge its step is whole to 3e-4 of the contrast

/// The model's parameters. Edge k runs along (cos, sin)(angle_rad[k]) through `px` and is curved by bend[k] (fixed).
struct Model {
  Eigen::Vector2d px;
  std::array<double, 2> angle_rad, bend;
  double blur_px, contrast, mean;
};

/// Columns: offsets of the two edges, their angles, blur, contrast, mean; and the residual last.
using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Vector<double, 7>;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double cost_of(const Matrix8& sums) { return sums(7, 7); }

template <class Floats>
[[gnu::always_inline]] inline void load(const float* from, Floats& values) {
  std::memcpy(&values, from, sizeof values);
}

/// One edge at some pixels: distance, position along it, and the two factors of the model.
template <class Floats>
struct EdgeAtPixels {
  Floats distance, along;
  EdgeProfile<Floats> profile;
};

/// Constants of one edge, in float.
struct EdgeConstants {
  float cosine, sine, half_bend, inverse_width;

  template <class Floats>
  [[nodiscard, gnu::always_inline]] inline EdgeAtPixels<Floats> at(const Floats& dx, const Floats& dy) const {
    const Floats along = cosine * dx + sine * dy;
    const Floats distance = cosine * dy - sine * dx - half_bend * along * along;
    return {distance, along, edge_profile<Floats>(distance * inverse_width)};
  }
};

/// The model in float, relative to the window's origin.
struct FloatModel {
  std::array<EdgeConstants, 2> edges;
  float x, y, slope, contrast, mean, minus_inverse_blur;

  FloatModel(const CornerWindow& window, const Model& model)
      : edges{},
        x(static_cast<float>(model.px.x() - window.origin.x())),
        y(static_cast<float>(model.px.y() - window.origin.y())),
        contrast(static_cast<float>(model.contrast)),
        mean(static_cast<float>(model.mean)),
        minus_inverse_blur(static_cast<float>(-1.0 / model.blur_px)) {
    const auto inverse_width = static_cast<float>(1.0 / (std::numbers::sqrt2 * model.blur_px));
    for (std::size_t k = 0; k < 2; ++k) {
      edges[k] = {static_cast<float>(std::cos(model.angle_rad[k])), static_cast<float>(std::sin(model.angle_rad[k])),
                  static_cast<float>(0.5 * model.bend[k]), inverse_width};
    }
    slope = static_cast<float>(2.0 * std::numbers::inv_sqrtpi * model.contrast) * inverse_width;
  }
};

/// Adds column[r] · column[c], c ≥ r, row by row; written out at compile time, which halves the time of a fit.
template <class Floats, std::size_t... r>
[[gnu::always_inline]] inline void add_products(const std::array<Floats, 8>& column, std::array<Floats, 36>& sums,
                                                std::index_sequence<r...>) {
  const auto add_row = [&]<std::size_t row, std::size_t... c>(std::index_sequence<c...>)
      __attribute__((always_inline)) {
    ((sums[row * 8 - row * (row - 1) / 2 + c] += column[row] * column[row + c]), ...);
  };
  (add_row.template operator()<r>(std::make_index_sequence<8 - r>{}), ...);
}

/// Adds the products of the columns of [J r] over the pixels from number i on, as many as fit into `Floats`.
template <class Floats>
[[gnu::always_inline]] inline void add_pixels(const CornerWindow& window, std::size_t i, const FloatModel& model,
                                              std::array<Floats, 36>& sums) {
  Floats x, y, grey;
  load(&window.x[i], x);
  load(&window.y[i], y);
  load(&window.grey[i], grey);
  const Floats dx = x - model.x, dy = y - model.y;
  const EdgeAtPixels<Floats> one = model.edges[0].at(dx, dy), two = model.edges[1].at(dx, dy);
  const Floats g1 = model.slope * one.profile.bell * two.profile.step;
  const Floats g2 = model.slope * one.profile.step * two.profile.bell;
  const Floats product = one.profile.step * two.profile.step;
  const std::array<Floats, 8> column{g1,
                                     g2,
                                     -g1 * one.along,
                                     -g2 * two.along,
                                     (g1 * one.distance + g2 * two.distance) * model.minus_inverse_blur,
                                     product,
                                     Floats{} + 1.0f,
                                     model.mean + model.contrast * product - grey};
  add_products(column, sums, std::make_index_sequence<8>{});
}

/// The 36 sums of products of the columns of [J r] over the pixels near the edges, in float: positions are small
/// numbers around the corner.
ALIDADE_VECTOR_CLONES void sum_near(const CornerWindow& window, const FloatModel& model, float* products) {
  std::array<Float8, 36> sums{};
  std::array<Float4, 36> last{};  // the pixels are a multiple of four
  std::size_t i = 0;
  for (; i + 8 <= window.num_near(); i += 8) add_pixels(window, i, model, sums);
  if (i < window.num_near()) add_pixels(window, i, model, last);
  for (std::size_t at = 0; at < sums.size(); ++at) {
    const Float8& s = sums[at];
    const Float4& t = last[at];
    products[at] = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7])) + ((t[0] + t[1]) + (t[2] + t[3]));
  }
}

Matrix8 near_sums(const CornerWindow& window, const Model& model) {
  std::array<float, 36> products;
  sum_near(window, FloatModel(window, model), products.data());
  Matrix8 full;
  const float* next = products.data();
  for (int r = 0; r < 8; ++r) {
    for (int c = r; c < 8; ++c) full(r, c) = full(c, r) = static_cast<double>(*next++);
  }
  return full;
}

/// Sums over all pixels. Far from the edges the product of the two steps is -1 or 1 and nothing else changes.
Matrix8 normal_sums(const CornerWindow& window, const Model& model) {
  Matrix8 sums = near_sums(window, model);
  for (const double product : {-1.0, 1.0}) {
    const FarPixels& far = window.far[product > 0.0 ? 1 : 0];
    const double grey = model.mean + product * model.contrast;
    const double residual = far.count * grey - far.sum;
    sums.block<3, 3>(5, 5) +=
        (Eigen::Matrix3d() << far.count, product * far.count, product * residual,  //
         product * far.count, far.count, residual,                                 //
         product * residual, residual, far.count * grey * grey - 2.0 * grey * far.sum + far.sum_of_squares)
            .finished();
  }
  return sums;
}

/// Moves the model by a step of the seven parameters; the corner is where the two displaced edges meet.
Model moved(const Model& model, const Vector7& step) {
  Model next = model;
  Eigen::Matrix2d normals;
  for (std::size_t k = 0; k < 2; ++k) {
    normals.row(static_cast<Eigen::Index>(k)) << -std::sin(model.angle_rad[k]), std::cos(model.angle_rad[k]);
    next.angle_rad[k] += step[2 + static_cast<Eigen::Index>(k)];
  }
  next.px -= normals.inverse() * step.head<2>();
  next.blur_px = std::clamp(model.blur_px + step[4], min_blur_px, max_blur_px);
  next.contrast += step[5];
  next.mean += step[6];
  return next;
}

/// Best mean and contrast for the start's geometry, by linear least squares.
Model with_best_greys(const CornerWindow& window, Model model) {
  model.contrast = 1.0;
  model.mean = 0.0;
  const Matrix8 sums = normal_sums(window, model);
  const Eigen::Vector2d step = sums.block<2, 2>(5, 5).inverse() * sums.block<2, 1>(5, 7);
  model.contrast -= step[0];
  model.mean -= step[1];
  return model;
}

struct Solution {
  Model model;
  Matrix8 sums;
  bool converged = false;
};

/// Damped Gauss–Newton step. Where the blur is at a limit and would cross it, the others step without it.
Vector7 damped_step(const Solution& at, double damping) {
  Matrix7 JtJ = at.sums.topLeftCorner<7, 7>();
  Vector7 Jtr = at.sums.topRightCorner<7, 1>();
  JtJ.diagonal() *= 1.0 + damping;
  const Vector7 step = -JtJ.ldlt().solve(Jtr);
  const double blur_px = at.model.blur_px;
  if (!(blur_px <= min_blur_px && step[4] < 0.0) && !(blur_px >= max_blur_px && step[4] > 0.0)) return step;
  JtJ.row(4).setZero();
  JtJ.col(4).setZero();
  JtJ(4, 4) = 1.0;
  Jtr[4] = 0.0;
  return -JtJ.ldlt().solve(Jtr);
}

Solution levenberg_marquardt(const CornerWindow& window, const Model& start, int max_iterations) {
  Solution best{start, normal_sums(window, start)};
  double damping = 1e-3;
  for (int i = 0; i < max_iterations; ++i) {
    const Vector7 step = damped_step(best, damping);
    const Model model = moved(best.model, step);
    const Matrix8 sums = normal_sums(window, model);
    const bool is_small = step.head<2>().norm() < converged_px;
    if (cost_of(sums) < cost_of(best.sums)) {
      best = {model, sums};
      damping *= 0.1;
    } else if (!is_small) {
      damping *= 10.0;
    }
    if (is_small || damping > 1e3) {  // or no step goes down: rounding to float is all that is left
      best.converged = true;
      break;
    }
  }
  return best;
}

/// Covariance of the corner: that of the two offsets, transformed to x and y.
Eigen::Matrix2d covariance_of(const Solution& solution, double variance) {
  const Matrix7 inverse = solution.sums.topLeftCorner<7, 7>().ldlt().solve(Matrix7::Identity());
  Eigen::Matrix2d normals;
  for (std::size_t k = 0; k < 2; ++k) {
    normals.row(static_cast<Eigen::Index>(k)) << -std::sin(solution.model.angle_rad[k]),
        std::cos(solution.model.angle_rad[k]);
  }
  const Eigen::Matrix2d px_from_offsets = normals.inverse();
  const Eigen::Matrix2d cov = variance * px_from_offsets * inverse.topLeftCorner<2, 2>() * px_from_offsets.transpose();
  return 0.5 * (cov + cov.transpose());
}

std::string_view reason_against(const CornerStart& start, const cv::Mat& photo) {
  const double lengths = start.along_cols.norm() * start.along_rows.norm();
  if (!start.px.allFinite() || !(std::abs(cross(start.along_cols, start.along_rows)) > min_sin_angle * lengths)) {
    return "the two edges nearly coincide";
  }
  const bool is_inside =
      start.px.x() > 1.0 && start.px.y() > 1.0 && start.px.x() < photo.cols - 2.0 && start.px.y() < photo.rows - 2.0;
  return is_inside ? "" : "outside the photo";
}

std::string_view reason_against(const CornerFit& fit, const CornerStart& start, const Solution& solution,
                                const CornerFitConfig& config) {
  if (!solution.converged || !fit.px.allFinite() || !fit.cov.allFinite()) return "the fit does not converge";
  if (!(std::abs(fit.contrast) >= config.min_contrast)) return "no contrast";
  if (!((fit.px - start.px).norm() <= config.max_move_px)) return "the fit moved away";
  if (!(fit.rms <= config.max_misfit * std::abs(fit.contrast))) return "not two edges: glare or something before it";
  if (!(fit.cov.trace() < max_sigma_px * max_sigma_px)) return "too uncertain";
  return {};
}

/// How far from the first edges a pixel can lie and still feel the solution's edges.
double reach_of(const Solution& solution, const Model& first, const CornerFitConfig& config) {
  const Model& model = solution.model;
  const double turned_rad =
      std::max(std::abs(model.angle_rad[0] - first.angle_rad[0]), std::abs(model.angle_rad[1] - first.angle_rad[1]));
  return edge_reach * model.blur_px + (model.px - first.px).norm() + config.max_half_window_px * turned_rad;
}

CornerFit fit_of(const Solution& solution, double num_pixels) {
  CornerFit fit;
  const Model& model = solution.model;
  const double variance = cost_of(solution.sums) / (num_pixels - 7.0);
  fit.px = model.px;
  fit.cov = covariance_of(solution, variance);
  fit.blur_px = model.blur_px;
  fit.contrast = -model.contrast;  // left normals: between +along_cols and +along_rows, d₁ and d₂ differ in sign
  fit.rms = std::sqrt(variance);
  return fit;
}

}  // namespace

CornerFit fit_corner(const cv::Mat& photo, const CornerStart& start, const CornerFitConfig& config) {
  CornerFit fit;
  fit.px = start.px;
  fit.reason = reason_against(start, photo);
  if (!fit.accepted()) return fit;
  const Model first = {.px = start.px,
                       .angle_rad = {std::atan2(start.along_cols.y(), start.along_cols.x()),
                                     std::atan2(start.along_rows.y(), start.along_rows.x())},
                       .bend = {start.bend_cols, start.bend_rows},
                       .blur_px = start.blur_px,
                       .contrast = 1.0,
                       .mean = 0.0};
  CornerWindow window = gather_window(photo, start, config, edge_reach * start.blur_px + 1.0);
  if (window.num_pixels() < min_pixels) {
    fit.reason = "the squares are too small";
    return fit;
  }
  Solution solution = levenberg_marquardt(window, with_best_greys(window, first), config.max_iterations);
  if (const double reach = reach_of(solution, first, config); reach > window.near_px) {
    window = gather_window(photo, start, config, reach + 1.0);
    solution = levenberg_marquardt(window, solution.model, config.max_iterations);
  }
  fit = fit_of(solution, window.num_pixels());
  fit.reason = reason_against(fit, start, solution, config);
  return fit;
}

}  // namespace alidade
