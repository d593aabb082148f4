#include "alidade/patches/pyramid_flow.h"

#include <Eigen/LU>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace alidade {
namespace {

constexpr int half_px = 5, side_px = 2 * half_px + 1;
constexpr std::size_t area_px = side_px * side_px;

/// Cuts a bilinear patch of side n around a point. False unless all its pixels are inside the image.
template <int n>
bool cut_patch(const cv::Mat& image, const Eigen::Vector2d& px,
               std::array<float, static_cast<std::size_t>(n* n)>& patch) {
  constexpr int half = n / 2;
  if (!(px.x() >= half && px.y() >= half && px.x() < image.cols - half - 1.0 && px.y() < image.rows - half - 1.0))
    return false;
  const int u = static_cast<int>(px.x()), v = static_cast<int>(px.y());
  const auto fu = static_cast<float>(px.x() - u), fv = static_cast<float>(px.y() - v);
  for (int row = 0; row < n; ++row) {
    const float* above = image.ptr<float>(v - half + row) + (u - half);
    const float* below = image.ptr<float>(v - half + row + 1) + (u - half);
    for (int col = 0; col < n; ++col) {
      const float top = above[col] + fu * (above[col + 1] - above[col]);
      const float bottom = below[col] + fu * (below[col + 1] - below[col]);
      patch[static_cast<std::size_t>(row * n + col)] = top + fv * (bottom - top);
    }
  }
  return true;
}

/// A patch with its derivatives at one level.
struct FlowPatch {
  std::array<float, area_px> grey, gx, gy;
  Eigen::Matrix2f inverse;

  /// False: outside, or without texture.
  bool cut(const cv::Mat& image, const Eigen::Vector2d& px) {
    constexpr int wide = side_px + 2;
    std::array<float, static_cast<std::size_t>(wide * wide)> around;
    if (!cut_patch<wide>(image, px, around)) return false;
    Eigen::Matrix2f normal = Eigen::Matrix2f::Zero();
    for (int row = 0; row < side_px; ++row) {
      for (int col = 0; col < side_px; ++col) {
        const float* at = around.data() + (row + 1) * wide + col + 1;
        const auto i = static_cast<std::size_t>(row * side_px + col);
        grey[i] = *at;
        gx[i] = 0.5f * (at[1] - at[-1]);
        gy[i] = 0.5f * (at[wide] - at[-wide]);
        normal += Eigen::Vector2f(gx[i], gy[i]) * Eigen::RowVector2f(gx[i], gy[i]);
      }
    }
    inverse = normal.inverse();
    return normal.determinant() > 1e-4f * normal.trace() * normal.trace() && normal.trace() > 1.0f;
  }
};

/// Gauss–Newton at one level; false if it leaves the image.
bool refine(const FlowPatch& patch, const cv::Mat& image, Eigen::Vector2d& px) {
  constexpr int max_iterations = 12;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    std::array<float, area_px> seen;
    if (!cut_patch<side_px>(image, px, seen)) return false;
    float sum_x = 0.0f, sum_y = 0.0f;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const float difference = patch.grey[i] - seen[i];
      sum_x += patch.gx[i] * difference;
      sum_y += patch.gy[i] * difference;
    }
    const Eigen::Vector2d step = (patch.inverse * Eigen::Vector2f(sum_x, sum_y)).cast<double>();
    if (!step.allFinite() || step.norm() > side_px) return false;
    px += step;
    if (step.squaredNorm() < 0.02 * 0.02) break;
  }
  return true;
}

}  // namespace

std::vector<cv::Mat> pyramid_of(const cv::Mat& smoothed, int max_levels) {
  std::vector<cv::Mat> levels = {smoothed};
  while (static_cast<int>(levels.size()) < max_levels && std::min(levels.back().rows, levels.back().cols) >= 64) {
    cv::Mat half;
    cv::pyrDown(levels.back(), half);
    levels.push_back(half);
  }
  return levels;
}

std::optional<Eigen::Vector2d> find_shifted(const std::vector<cv::Mat>& from, const std::vector<cv::Mat>& to,
                                            const Eigen::Vector2d& px, const Eigen::Vector2d& guess_px) {
  Eigen::Vector2d found = guess_px;
  for (int level = static_cast<int>(from.size()) - 1; level >= 0; --level) {
    const double scale = 1.0 / (1 << level);
    FlowPatch patch;
    Eigen::Vector2d at = found * scale;
    const auto l = static_cast<std::size_t>(level);
    const bool has_found = patch.cut(from[l], px * scale) && refine(patch, to[l], at);
    if (!has_found && level == 0) return std::nullopt;
    if (has_found) found = at / scale;  // a coarse level may lack room at the border, or texture
  }
  return found;
}

}  // namespace alidade
