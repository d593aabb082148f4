#include "alidade/patches/reference_patch.h"

#include <Eigen/LU>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace alidade {
namespace {

constexpr double min_scale = 0.5, max_scale = 2.0;  // beyond that, the two images hardly show the same
constexpr double min_patch_contrast = 3.0;          // σ of the grey values; less is noise

bool is_usable(const Eigen::Matrix2d& warp) {
  if (!warp.allFinite() || !(warp.determinant() > 0.0)) return false;
  // Singular values of a 2×2 matrix: sum and difference of its two conformal parts, halved.
  const double sum = std::hypot(warp(0, 0) + warp(1, 1), warp(1, 0) - warp(0, 1));
  const double difference = std::hypot(warp(0, 0) - warp(1, 1), warp(1, 0) + warp(0, 1));
  return 0.5 * (sum - difference) > min_scale && 0.5 * (sum + difference) < max_scale;
}

/// Projects the derivatives orthogonal to gain and bias, and computes their products.
void finish(PatchView& view) {
  const auto project_out = [&](std::array<float, PatchView::area_px>& values) {
    double sum = 0.0, along = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      sum += values[i];
      along += values[i] * view.shade[i];
    }
    const auto mean = static_cast<float>(sum / PatchView::area_px), share = static_cast<float>(along / view.energy);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] -= mean + share * view.shade[i];
  };
  project_out(view.along_u);
  project_out(view.along_v);
  double uu = 0.0, uv = 0.0, vv = 0.0;
  for (std::size_t i = 0; i < view.along_u.size(); ++i) {
    uu += view.along_u[i] * view.along_u[i];
    uv += view.along_u[i] * view.along_v[i];
    vv += view.along_v[i] * view.along_v[i];
  }
  view.shift_information << uu, uv, uv, vv;
}

/// One pixel more than a view on every side, for its derivatives.
constexpr int wide_half_px = PatchView::half_px + 1, wide_side_px = 2 * wide_half_px + 1;
using WideView = std::array<float, static_cast<std::size_t>(wide_side_px) * wide_side_px>;

/// The patch resampled through a linear map, bilinearly.
WideView warped(std::span<const std::uint8_t, ReferencePatch::area_px> grey, const Eigen::Matrix2f& first_from_here) {
  constexpr int half = wide_half_px, side = wide_side_px;
  constexpr float last = ReferencePatch::side_px - 1.001f;
  WideView wide{};
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) {
      const Eigen::Vector2f at = first_from_here * Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y));
      const float s = std::clamp(at.x() + ReferencePatch::half_px, 0.0f, last),
                  t = std::clamp(at.y() + ReferencePatch::half_px, 0.0f, last);
      const int col = static_cast<int>(s), row = static_cast<int>(t);
      const float a = s - static_cast<float>(col), b = t - static_cast<float>(row);
      const std::uint8_t* const g = &grey[static_cast<std::size_t>(row * ReferencePatch::side_px + col)];
      wide[static_cast<std::size_t>((y + half) * side + x + half)] =
          (1 - b) * ((1 - a) * g[0] + a * g[1]) +
          b * ((1 - a) * g[ReferencePatch::side_px] + a * g[ReferencePatch::side_px + 1]);
    }
  }
  return wide;
}

}  // namespace

ReferencePatch::ReferencePatch(const cv::Mat& grey, int u, int v) {
  for (int row = 0; row < side_px; ++row) {
    const std::uint8_t* const from = grey.ptr<std::uint8_t>(v - half_px + row) + u - half_px;
    std::copy(from, from + side_px, grey_.begin() + static_cast<std::ptrdiff_t>(row) * side_px);
  }
}

ReferencePatch::ReferencePatch(std::span<const std::uint8_t, area_px> grey) {
  std::copy(grey.begin(), grey.end(), grey_.begin());
}

std::optional<PatchView> ReferencePatch::seen_through(const Eigen::Matrix2d& here_from_first) const {
  if (!is_usable(here_from_first)) return std::nullopt;
  const WideView wide = warped(grey_, here_from_first.inverse().cast<float>());
  constexpr int side = wide_side_px;
  PatchView view;
  double sum = 0.0;
  std::size_t i = 0;
  for (int y = 1; y < side - 1; ++y) {
    for (int x = 1; x < side - 1; ++x, ++i) {
      const float* const g = &wide[static_cast<std::size_t>(y * side + x)];
      view.shade[i] = g[0];
      view.along_u[i] = 0.5f * (g[1] - g[-1]);
      view.along_v[i] = 0.5f * (g[side] - g[-side]);
      sum += g[0];
    }
  }
  const auto mean = static_cast<float>(sum / PatchView::area_px);
  for (float& shade : view.shade) {
    shade -= mean;
    view.energy += shade * shade;
  }
  if (!(view.energy > min_patch_contrast * min_patch_contrast * PatchView::area_px)) return std::nullopt;
  for (std::size_t row = 0; row < PatchView::side_px; ++row)
    for (std::size_t col = 0; col < PatchView::side_px; ++col)
      view.grey[row * PatchView::row_px + col] =
          static_cast<std::int16_t>(std::lround(view.shade[row * PatchView::side_px + col]));
  finish(view);
  return view;
}

cv::Mat smoothed_for_search(const cv::Mat& grey) {
  cv::Mat bytes, smoothed;
  grey.convertTo(bytes, CV_8U);
  cv::GaussianBlur(bytes, smoothed, {3, 3}, 0.0, 0.0, cv::BORDER_REPLICATE);  // a kernel of 3 is [1 2 1]/4
  return smoothed;
}

}  // namespace alidade
