#include "alidade/target/target_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace alidade {

SearchWindow search_window(const cv::Mat& image, const std::optional<TargetExpectation>& expected, double margin_px) {
  if (!expected || !expected->px.allFinite()) return {0, 0, image.cols, image.rows};
  const double reach = 4.0 * expected->sigma_px + margin_px;
  const auto low = [&](double at, int size) {
    return static_cast<int>(std::clamp(std::floor(at - reach), 0.0, 1.0 * size));
  };
  const auto high = [&](double at, int size) {
    return static_cast<int>(std::clamp(std::ceil(at + reach) + 1.0, 0.0, 1.0 * size));
  };
  const int u = low(expected->px.x(), image.cols), v = low(expected->px.y(), image.rows);
  return {u, v, high(expected->px.x(), image.cols) - u, high(expected->px.y(), image.rows) - v};
}

TargetDetection lost_target(std::string reason) {
  TargetDetection lost;
  lost.reason = std::move(reason);
  return lost;
}

std::string two_candidates(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return fmt::format("two candidates at ({:.0f}, {:.0f}) and ({:.0f}, {:.0f})", a.x(), a.y(), b.x(), b.y());
}

}  // namespace alidade
