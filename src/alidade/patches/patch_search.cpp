#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "alidade/geometry/vector_clones.h"
#include "alidade/patches/reference_patch.h"

namespace alidade {
namespace {

constexpr int half = PatchView::half_px, side = PatchView::side_px, row_px = PatchView::row_px;

/// Σ template · image with the patch's top-left at `image`. Reads row_px pixels per row: the last ones count as zero.
ALIDADE_VECTOR_CLONES int product_at(const std::int16_t* grey, const std::uint8_t* image, std::size_t stride) {
  int sum = 0;
  for (int row = 0; row < side; ++row) {
    for (int col = 0; col < row_px; ++col) sum += grey[col] * static_cast<std::int16_t>(image[col]);
    grey += row_px;
    image += stride;
  }
  return sum;
}

/// Positions to evaluate: whole pixels around the expected one, far enough inside to read rows of row_px pixels.
struct SearchWindow {
  int u_min = 0, u_max = -1, v_min = 0, v_max = -1;
};

SearchWindow window_of(const cv::Mat& image, const Eigen::Vector2d& centre, const Eigen::Matrix2d& S,
                       const PatchSearch& search) {
  const double reach_u = std::min(search.num_sigma * std::sqrt(S(0, 0)), search.max_half_px);
  const double reach_v = std::min(search.num_sigma * std::sqrt(S(1, 1)), search.max_half_px);
  const auto lower = [](double value, int least) { return std::max(static_cast<int>(std::ceil(value)), least); };
  const auto upper = [](double value, int most) { return std::min(static_cast<int>(std::floor(value)), most); };
  // One more pixel than the patch, for the subpixel fit.
  return {lower(centre.x() - reach_u, half + 1), upper(centre.x() + reach_u, image.cols - row_px + half - 1),
          lower(centre.y() - reach_v, half + 1), upper(centre.y() + reach_v, image.rows - half - 2)};
}

/// Sums over the patch's square at every position of one row of the window, updated row by row.
class BoxSums {
 public:
  BoxSums(const cv::Mat& image, const SearchWindow& window)
      : image_(image), window_(window), width_(window.u_max - window.u_min + side), sum_(size()), squares_(size()) {
    for (int v = window.v_min - half; v < window.v_min + half; ++v) change(v, 1);
  }
  /// Moves to row v: adds the last row of its square.
  void enter(int v) { change(v + half, 1); }
  /// Removes the first row of its square.
  void leave(int v) { change(v - half, -1); }
  /// n Σ g² − (Σ g)² over the patch at a position, for all positions of the row.
  void spreads(std::vector<float>& out) const {
    int sum = 0, squares = 0;
    for (int c = 0; c < side - 1; ++c) add(c, sum, squares, 1);
    for (int c = 0; c <= window_.u_max - window_.u_min; ++c) {
      add(c + side - 1, sum, squares, 1);
      out[static_cast<std::size_t>(c)] =
          static_cast<float>(squares) - static_cast<float>(sum) * static_cast<float>(sum) / PatchView::area_px;
      add(c, sum, squares, -1);
    }
  }

 private:
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(width_); }
  void add(int c, int& sum, int& squares, int sign) const {
    sum += sign * sum_[static_cast<std::size_t>(c)];
    squares += sign * squares_[static_cast<std::size_t>(c)];
  }
  void change(int v, int sign) {
    const std::uint8_t* const g = image_.ptr<std::uint8_t>(v) + window_.u_min - half;
    for (std::size_t c = 0; c < size(); ++c) {
      sum_[c] += sign * g[c];
      squares_[c] += sign * g[c] * g[c];
    }
  }

  const cv::Mat& image_;
  SearchWindow window_;
  int width_;
  std::vector<int> sum_, squares_;
};

/// The best whole pixel; the correlation is negative if there is none.
struct BestPlace {
  int u = 0, v = 0, num_compared = 0;
  double correlation = -1.0;
};

BestPlace best_place(const cv::Mat& image, const PatchView& view, const Eigen::Vector2d& centre,
                     const Eigen::Matrix2d& S, const PatchSearch& search) {
  BestPlace best;
  const SearchWindow window = window_of(image, centre, S, search);
  if (window.u_max < window.u_min || window.v_max < window.v_min) return best;
  const Eigen::Matrix2d information = S.inverse();
  const double most = search.num_sigma * search.num_sigma;
  BoxSums sums(image, window);
  std::vector<float> spreads(static_cast<std::size_t>(window.u_max - window.u_min + 1));
  double best_squared = 0.0;
  for (int v = window.v_min; v <= window.v_max; ++v) {
    sums.enter(v);
    sums.spreads(spreads);
    for (int u = window.u_min; u <= window.u_max; ++u) {
      const Eigen::Vector2d d = Eigen::Vector2d(u, v) - centre;
      if (d.x() * (information(0, 0) * d.x() + 2.0 * information(0, 1) * d.y()) + information(1, 1) * d.y() * d.y() >
          most)
        continue;
      ++best.num_compared;
      const int product = product_at(view.grey.data(), image.ptr<std::uint8_t>(v - half) + u - half, image.step);
      const double spread = spreads[static_cast<std::size_t>(u - window.u_min)];
      if (product <= 0 || !(spread > 0.0)) continue;
      const double squared = static_cast<double>(product) * product / spread;
      if (squared <= best_squared) continue;
      best_squared = squared;
      best.u = u;
      best.v = v;
    }
    sums.leave(v);
  }
  best.correlation = best_squared > 0.0 ? std::sqrt(best_squared / view.energy) : -1.0;
  return best;
}

/// Bilinear grey values of the patch's square at a subpixel position.
void sample(const cv::Mat& image, const Eigen::Vector2d& px, std::array<float, PatchView::area_px>& out) {
  const int u = static_cast<int>(std::floor(px.x())), v = static_cast<int>(std::floor(px.y()));
  const auto a = static_cast<float>(px.x() - u), b = static_cast<float>(px.y() - v);
  const float w00 = (1 - a) * (1 - b), w01 = a * (1 - b), w10 = (1 - a) * b, w11 = a * b;
  std::size_t i = 0;
  for (int row = 0; row < side; ++row) {
    const std::uint8_t* const g = image.ptr<std::uint8_t>(v - half + row) + u - half;
    const std::uint8_t* const h = image.ptr<std::uint8_t>(v - half + row + 1) + u - half;
    for (int col = 0; col < side; ++col, ++i)
      out[i] = w00 * g[col] + w01 * g[col + 1] + w10 * h[col] + w11 * h[col + 1];
  }
}

bool is_inside(const cv::Mat& image, const Eigen::Vector2d& px) {
  return px.x() >= half && px.y() >= half && px.x() < image.cols - half - 1 && px.y() < image.rows - half - 1;
}

/// Gauss–Newton from a whole pixel. Empty if it leaves the surroundings of that pixel.
std::optional<PatchMatch> between_pixels(const cv::Mat& image, const PatchView& view, const BestPlace& from) {
  constexpr int max_iterations = 8;
  constexpr double small_step_px = 0.01, max_px = 1.5;
  const Eigen::Matrix2d inverse = view.shift_information.inverse();
  if (!inverse.allFinite()) return std::nullopt;
  const Eigen::Vector2d start(from.u, from.v);
  PatchMatch match{start, from.correlation, 0.0, from.num_compared};
  std::array<float, PatchView::area_px> seen{};
  double variance = 0.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!is_inside(image, match.px)) return std::nullopt;
    sample(image, match.px, seen);
    float sum = 0.0f, product = 0.0f, squares = 0.0f, along_u = 0.0f, along_v = 0.0f;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      sum += seen[i];
      squares += seen[i] * seen[i];
      product += seen[i] * view.shade[i];
      along_u += seen[i] * view.along_u[i];
      along_v += seen[i] * view.along_v[i];
    }
    const double gain = product / view.energy;
    if (!(gain > 0.1)) return std::nullopt;
    const double spread = squares - sum * sum / PatchView::area_px;
    const Eigen::Vector2d step = inverse * Eigen::Vector2d(along_u, along_v) / gain;
    variance = (spread - gain * product) / (gain * gain) / (PatchView::area_px - 4);
    match.correlation = product / std::sqrt(std::max(spread * view.energy, 1e-9));
    match.px -= step;
    if (!((match.px - start).cwiseAbs().maxCoeff() < max_px)) return std::nullopt;
    if (step.norm() < small_step_px) break;
  }
  // Noise smoothed twice by [1 2 1]/4 keeps 36/256 of its variance, but 9/16 at a sixth of a cycle per pixel, where a
  // patch's derivatives are: the residuals count that much more.
  constexpr double lost_by_smoothing = 4.0;
  match.sigma_px = std::sqrt(std::max(variance, 0.0) * lost_by_smoothing * 0.5 * inverse.trace());
  return match;
}

}  // namespace

std::optional<PatchMatch> find_patch(const cv::Mat& smoothed, const PatchView& view, const Eigen::Vector2d& expected_px,
                                     const Eigen::Matrix2d& S, const PatchSearch& search) {
  if (!expected_px.allFinite() || !S.allFinite()) return std::nullopt;
  const BestPlace best = best_place(smoothed, view, expected_px, S, search);
  if (!(best.correlation >= search.min_correlation)) return std::nullopt;
  return between_pixels(smoothed, view, best);
}

}  // namespace alidade
