#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/spot/spot_fit.h"

namespace alidade {
namespace {

using Vector7 = Eigen::Vector<double, 7>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr double saturated_share = 0.97;  // of the light at which a pixel is cut off: noise stays above

double step_of(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// Inverse of step_of(), error below 0.005. S. Winitzki, "A handy approximation for the error function", 2008.
double place_on_step(double share) {
  constexpr double a = 0.147;
  const double y = 2.0 * share - 1.0, log_term = std::log(1.0 - y * y);
  const double half = 2.0 / (std::numbers::pi * a) + 0.5 * log_term;
  return std::copysign(std::numbers::sqrt2 * std::sqrt(std::sqrt(half * half - log_term / a) - half), y);
}

/// The print around the spot: two levels, and for each pixel the signed distance from the edge between them.
struct Print {
  Eigen::Index u_min = 0, v_min = 0;
  double ink = 0.0, paper = 0.0;  ///< Grey levels.
  double blur_px = 0.7;           ///< Of its edges.
  Image distance_px;              ///< Positive on paper; cut where the edge's blur ends.

  [[nodiscard]] bool has_contrast() const { return paper > ink + 0.1 * paper; }

  /// Bilinear, at a position in pixels of the part.
  [[nodiscard]] double distance(double u, double v) const {
    const double x = std::clamp(u - static_cast<double>(u_min), 0.0, static_cast<double>(distance_px.cols()) - 1.001);
    const double y = std::clamp(v - static_cast<double>(v_min), 0.0, static_cast<double>(distance_px.rows()) - 1.001);
    const auto i = static_cast<Eigen::Index>(x), j = static_cast<Eigen::Index>(y);
    const double a = x - static_cast<double>(i), b = y - static_cast<double>(j);
    const auto at = [&](Eigen::Index row, Eigen::Index col) { return static_cast<double>(distance_px(row, col)); };
    return (1.0 - b) * ((1.0 - a) * at(j, i) + a * at(j, i + 1)) +
           b * ((1.0 - a) * at(j + 1, i) + a * at(j + 1, i + 1));
  }
};

float quantile(const Image& image, double share) {
  std::vector<float> values(image.data(), image.data() + image.size());
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Blur of the edges: a blurred step's gradient g has ∫ g² / ∫ g = 1/(2 √π σ); differences over two pixels add 1/3.
double blur_of(const Image& paper) {
  double sum = 0.0, squares = 0.0;
  for (Eigen::Index v = 1; v + 1 < paper.rows(); ++v) {
    for (Eigen::Index u = 1; u + 1 < paper.cols(); ++u) {
      const float x = 0.5F * (paper(v, u + 1) - paper(v, u - 1)), y = 0.5F * (paper(v + 1, u) - paper(v - 1, u));
      const double g = static_cast<double>(std::hypot(x, y));
      if (g < 0.08) continue;  // noise
      sum += g;
      squares += g * g;
    }
  }
  if (!(squares > 0.0)) return 0.7;
  const double sigma = sum / squares / (2.0 * std::sqrt(std::numbers::pi));
  return std::sqrt(std::clamp(sigma * sigma - 1.0 / 3.0, 0.2, 9.0));
}

/// Share of the spot's light that the background's channels saw: without it the background has two levels.
float leak_of(const Image& background, const Image& light, float ink, float paper) {
  float best = 0.0F, least = std::numeric_limits<float>::infinity();
  for (float leak = 0.0F; leak < 0.5F; leak += 0.01F) {
    const Image clean = background - leak * light;
    const float cost = (clean - ink).abs().min((clean - paper).abs()).min(0.2F * (paper - ink)).sum();
    if (cost < least) best = leak;
    least = std::min(least, cost);
  }
  return best;
}

Print print_around(const SpotSignal& signal, const SpotPlace& spot) {
  Print print;
  const double reach = 3.5 * spot.radius_px + 6.0;
  print.u_min = std::max<Eigen::Index>(0, static_cast<Eigen::Index>(spot.px.x() - reach));
  print.v_min = std::max<Eigen::Index>(0, static_cast<Eigen::Index>(spot.px.y() - reach));
  const Eigen::Index u_end = std::min(signal.light.cols(), static_cast<Eigen::Index>(spot.px.x() + reach) + 2);
  const Eigen::Index v_end = std::min(signal.light.rows(), static_cast<Eigen::Index>(spot.px.y() + reach) + 2);
  const auto around = [&](const Image& image) -> Image {
    return image.block(print.v_min, print.u_min, v_end - print.v_min, u_end - print.u_min);
  };
  Image background = around(signal.background);
  float ink = quantile(background, 0.08), paper = quantile(background, 0.92);
  if (signal.background_is_lit)
    background -= leak_of(background, around(signal.light), ink, paper) * around(signal.light);
  ink = quantile(background, 0.08);
  paper = quantile(background, 0.92);
  print.ink = static_cast<double>(ink);
  print.paper = static_cast<double>(paper);
  const Image share = (background - ink) / std::max(1.0F, paper - ink);
  print.blur_px = blur_of(share);
  const double blur_px = print.blur_px;
  print.distance_px = share.unaryExpr([blur_px](float value) {
    return static_cast<float>(blur_px * place_on_step(std::clamp(static_cast<double>(value), 0.01, 0.99)));
  });
  return print;
}

/// Parameters: μ, ln s, ln Σ₀₀, ln Σ₁₁, artanh of the correlation, r.
struct EdgeModel {
  Eigen::Matrix2d inverse, print_from_px;
  Vector7 p;
  double edge_blur_px;

  EdgeModel(const Vector7& parameters, double blur_px) : p(parameters) {
    const double a = std::exp(p[3]), d = std::exp(p[4]), c = std::tanh(p[5]) * std::sqrt(a * d);
    const Eigen::Matrix2d cov{{a, c}, {c, d}};
    inverse = Eigen::Matrix2d{{d, -c}, {-c, a}} / std::max(1e-9, a * d - c * c);
    // Σ' Σ⁻¹ = 1 − b² Σ⁻¹
    print_from_px = Eigen::Matrix2d::Identity() - blur_px * blur_px * inverse;
    const double shrink = std::clamp(0.5 * print_from_px.trace(), 0.05, 1.0);
    if (shrink <= 0.05) print_from_px = 0.05 * Eigen::Matrix2d::Identity();
    edge_blur_px = blur_px * std::sqrt(shrink);
  }
  [[nodiscard]] double light(const Print& print, const Eigen::Vector2d& px) const {
    const Eigen::Vector2d offset = px - p.head<2>();
    const Eigen::Vector2d seen = p.head<2>() + print_from_px * offset;
    const double paper = step_of(print.distance(seen.x(), seen.y()) / edge_blur_px);
    return std::exp(p[2] - 0.5 * offset.dot(inverse * offset)) * (p[6] + (1.0 - p[6]) * paper);
  }
};

/// The pixels of the fit and the prior of r.
class EdgeFit {
 public:
  EdgeFit(const SpotSignal& signal, const SpotPlace& start, Print print)
      : print_(std::move(print)), ink_return_(print_.ink / print_.paper) {
    const double reach = 3.0 * start.radius_px + 2.0, noise = signal.sum_sigma;
    const Eigen::Index rows = signal.light.rows(), cols = signal.light.cols();
    for (Eigen::Index v = 0; v < rows; ++v) {
      if (std::abs(static_cast<double>(v) - start.px.y()) > reach) continue;
      for (Eigen::Index u = 0; u < cols; ++u) {
        const Eigen::Vector2d px(static_cast<double>(u), static_cast<double>(v));
        if ((px - start.px).norm() > reach) continue;
        const double light = static_cast<double>(signal.light(v, u)) - start.offset_light;
        const double edge = signal.edge_sigma_px * static_cast<double>(signal.edge(v, u));
        pixels_.push_back({px, light, noise * noise + edge * edge, 0.0, signal.is_saturated(v, u) != 0});
      }
    }
    set_speckle(0.02);
  }

  /// Of light that varies by this contrast, and of a shape that is not quite a Gaussian.
  void set_speckle(double contrast) {
    for (Pixel& pixel : pixels_)
      pixel.inverse_sigma = 1.0 / std::sqrt(pixel.variance + std::pow(contrast * pixel.light, 2));
  }
  /// The contrast that the residuals show; a few bright pixels are most of the light, and the fit takes up their share.
  [[nodiscard]] double speckle_of(const Vector7& p) const {
    const Eigen::VectorXd r = residuals(p);
    double excess = 0.0, light2 = 0.0, light4 = 0.0;
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const Pixel& pixel = pixels_[i];
      if (pixel.is_saturated) continue;
      const double off = r[static_cast<Eigen::Index>(i)] / pixel.inverse_sigma, square = pixel.light * pixel.light;
      excess += off * off - pixel.variance;
      light2 += square;
      light4 += square * square;
    }
    const double num = light4 > 0.0 ? light2 * light2 / light4 : 0.0;
    const double num_free = std::max(0.0, num - 5.0);
    return light2 > 0.0 && num_free > 0.0 ? speckle_contrast(num * excess / light2, num_free)
                                          : speckle_contrast(0.0, 0.0);
  }

  [[nodiscard]] Vector7 start(const SpotPlace& spot) const {
    Vector7 p;
    const double log_square = std::log(spot.radius_px * spot.radius_px);
    p << spot.px, std::log(std::max(1.0, spot.peak)), log_square, log_square, 0.0, ink_return_;
    return p;
  }
  [[nodiscard]] Eigen::VectorXd residuals(const Vector7& p) const {
    const EdgeModel model(p, print_.blur_px);
    Eigen::VectorXd r(static_cast<Eigen::Index>(pixels_.size()) + 1);
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const Pixel& pixel = pixels_[i];
      const double excess = model.light(print_, pixel.px) - pixel.light;
      const bool is_free = pixel.is_saturated && excess > -(1.0 - saturated_share) * pixel.light;
      r[static_cast<Eigen::Index>(i)] = is_free ? 0.0 : pixel.inverse_sigma * excess;
    }
    r[r.size() - 1] = (p[6] - ink_return_) / (0.03 + 0.3 * ink_return_);  // inks differ between colours
    return r;
  }
  /// What residuals that neighbours share count more than their squares: correlated by ρ from pixel to pixel,
  /// (1 + ρ)/(1 − ρ) along each axis.
  [[nodiscard]] double shared_gain(const Vector7& p) const {
    const Eigen::VectorXd r = residuals(p);
    double products = 0.0, squares = 0.0;
    for (std::size_t i = 0; i + 1 < pixels_.size(); ++i) {
      if ((pixels_[i + 1].px - pixels_[i].px - Eigen::Vector2d::UnitX()).norm() > 0.1) continue;
      const auto k = static_cast<Eigen::Index>(i);
      products += r[k] * r[k + 1];
      squares += 0.5 * (r[k] * r[k] + r[k + 1] * r[k + 1]);
    }
    const double rho = squares > 0.0 ? std::clamp(products / squares, 0.0, 0.6) : 0.0;
    return std::pow((1.0 + rho) / (1.0 - rho), 2);
  }
  [[nodiscard]] Eigen::Index num_pixels() const { return static_cast<Eigen::Index>(pixels_.size()); }

 private:
  struct Pixel {
    Eigen::Vector2d px;
    double light, variance, inverse_sigma;
    bool is_saturated;
  };
  std::vector<Pixel> pixels_;
  Print print_;
  double ink_return_;
};

struct EdgeSolution {
  Vector7 p;
  double cost = 0.0;
  Matrix7 normal = Matrix7::Identity();
  bool converged = false;
};

EdgeSolution best_edges(const EdgeFit& fit, const Vector7& start) {
  EdgeSolution best{start, 0.0};
  Eigen::VectorXd r = fit.residuals(start);
  best.cost = r.squaredNorm();
  double damping = 1e-2;
  constexpr int max_iterations = 40;  // 8 are typical
  for (int i = 0; i < max_iterations && !best.converged; ++i) {
    Eigen::MatrixXd J(r.size(), 7);
    for (int k = 0; k < 7; ++k) {
      constexpr double step = 1e-4;  // px, logarithms and shares alike
      Vector7 ahead = best.p, behind = best.p;
      ahead[k] += step;
      behind[k] -= step;
      J.col(k) = (fit.residuals(ahead) - fit.residuals(behind)) / (2.0 * step);
    }
    best.normal = J.transpose() * J;
    const Vector7 gradient = J.transpose() * r;
    for (bool is_better = false; !is_better && damping < 1e8;) {
      Matrix7 damped = best.normal;
      damped.diagonal() *= 1.0 + damping;
      damped.diagonal().array() += 1e-9;
      const Vector7 step = -solve_symmetric(damped, gradient);
      const Eigen::VectorXd next = fit.residuals(best.p + step);
      is_better = next.squaredNorm() < best.cost;
      best.converged = step.head<2>().norm() < 1e-3 && (is_better || damping > 1e4);
      if (is_better) {
        best.p += step;
        best.cost = next.squaredNorm();
        r = next;
      }
      damping *= is_better ? 0.2 : 8.0;
      if (best.converged) break;
    }
    if (damping >= 1e8) best.converged = true;
  }
  return best;
}

/// The centroid where nothing better is known: it leans to the paper by up to √(2/π) of the spot's radius.
SpotPlace with_wide_sigma(SpotPlace spot) {
  spot.cov += 0.64 * spot.radius_px * spot.radius_px * Eigen::Matrix2d::Identity();
  return spot;
}

/// What the model of light and print misses.
Eigen::Matrix2d missed_by_model(const SpotSignal& signal, const SpotPlace& start, const Eigen::Vector2d& moved,
                                double radius_px) {
  // It grows with the correction; without a photo to compare with the print is less known. So does a clipped core: it
  // is the most informative part.
  const double share = signal.background_is_lit || signal.is_modelled ? 0.15 : start.is_saturated ? 0.1 : 0.05;
  double radii = 0.0;  // squares of shares of the radius
  // Of a clipped spot only the slopes are seen, where pixels, blur and beam are not quite Gaussian.
  if (start.is_saturated) radii += 0.01;
  // A mosaic blurs each colour by its own neighbours, and JPEG keeps colours at half the resolution: the light is
  // blurred otherwise than the print, and into the other side.
  if (signal.is_interpolated) radii += 0.0225;
  if (signal.step > 0.0) radii += 0.04;
  // A grey photo made of a colour one hides what its colours cut, and a model what the light does near an edge.
  if (signal.is_modelled) radii += 0.0144;
  return share * share * moved * moved.transpose() +
         (1e-4 + radii * radius_px * radius_px) * Eigen::Matrix2d::Identity();
}

}  // namespace

SpotPlace fit_on_edge(const SpotSignal& signal, const SpotPlace& start) {
  Print print = print_around(signal, start);
  const bool is_lit_up = signal.background_is_lit && start.is_saturated;
  if (!print.has_contrast() || is_lit_up) return with_wide_sigma(start);
  EdgeFit fit(signal, start, std::move(print));
  EdgeSolution solution = best_edges(fit, fit.start(start));
  fit.set_speckle(fit.speckle_of(solution.p));
  solution = best_edges(fit, solution.p);
  const Eigen::Vector2d moved = solution.p.head<2>() - start.px;
  const double dof = static_cast<double>(fit.num_pixels()) - 6.0;
  const double radius_px = std::exp(0.25 * (solution.p[3] + solution.p[4]));
  const bool is_believable = solution.converged && dof > 5.0 && moved.norm() < 2.5 * start.radius_px + 1.0 &&
                             radius_px > 0.3 * start.radius_px && radius_px < 3.0 * start.radius_px;
  if (!is_believable) return with_wide_sigma(start);
  SpotPlace spot = start;
  spot.px = solution.p.head<2>();
  spot.radius_px = radius_px;
  const Matrix7 inverse = inverse_symmetric(solution.normal);
  spot.cov = std::max(1.0, fit.shared_gain(solution.p) * solution.cost / dof) * inverse.topLeftCorner<2, 2>();
  spot.cov += missed_by_model(signal, start, moved, radius_px);
  if (!spot.cov.allFinite()) return with_wide_sigma(start);
  return spot;
}

}  // namespace alidade
