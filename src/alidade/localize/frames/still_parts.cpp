#include "alidade/localize/frames/still_parts.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace alidade {
namespace {

constexpr int every = 3;             // images: between two of a video hardly anything moves
constexpr double shrunk = 0.5;       // halves the noise; a clock's digits are wide enough
constexpr float min_edge = 8.0f;     // grey values per pixel: an edge,
constexpr float clear_edge = 16.0f;  // and one near which unchanged pixels count as still
constexpr int enough_looks = 8;      // comparisons of an edge while the scene moved
constexpr double still_looks = 0.9, moved_edges = 0.6;
constexpr double moved_share = 0.5, unmoved_share = 0.15;  // of the change by a shift of one downsampled pixel

}  // namespace

struct StillParts::Counts {
  int num_images = 0;
  cv::Size size;
  cv::Mat before;        ///< Reference image of the comparison, as floats.
  cv::Mat looks, still;  ///< Number of comparisons of an edge, and of those without change.
  cv::Mat parts;         ///< 255: still.
};

StillParts::StillParts() : counts_(std::make_unique<Counts>()) {}
StillParts::~StillParts() = default;
StillParts::StillParts(StillParts&&) noexcept = default;
StillParts& StillParts::operator=(StillParts&&) noexcept = default;

bool StillParts::add(const cv::Mat& smoothed) {
  Counts& counts = *counts_;
  if (counts.num_images++ % every != 0) return false;
  cv::Mat now;
  cv::resize(smoothed, now, {}, shrunk, shrunk, cv::INTER_AREA);
  now.convertTo(now, CV_32F);
  if (counts.before.empty()) {
    counts.size = smoothed.size();
    counts.before = now;
    counts.looks = cv::Mat::zeros(now.size(), CV_16U);
    counts.still = counts.looks.clone();
    counts.parts = cv::Mat::zeros(now.size(), CV_8U);
    return false;
  }
  cv::Mat along_u, along_v, edge;  // gradient of the image before: the change by a shift of one pixel
  cv::Sobel(counts.before, along_u, CV_32F, 1, 0, 3, 0.125);
  cv::Sobel(counts.before, along_v, CV_32F, 0, 1, 3, 0.125);
  cv::magnitude(along_u, along_v, edge);
  const cv::Mat change = cv::abs(now - counts.before), is_edge = edge > min_edge;
  const cv::Mat has_moved = is_edge & (change > moved_share * edge);
  const int num_edges = cv::countNonZero(is_edge);
  if (num_edges == 0 || cv::countNonZero(has_moved) < moved_edges * num_edges) return false;  // the scene does not move
  counts.before = now;
  // The inside of a stroke, near its own edges, stands still; the edges change with what passes behind it.
  cv::Mat near;
  cv::dilate(edge, near, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
  const cv::Mat is_near = near > clear_edge, is_still = is_near & (change < unmoved_share * near);
  cv::add(counts.looks, 1, counts.looks, is_near);
  cv::add(counts.still, 1, counts.still, is_still);
  cv::Mat looks, still, parts;
  counts.looks.convertTo(looks, CV_32F);
  counts.still.convertTo(still, CV_32F);
  parts = (looks >= enough_looks) & (still >= still_looks * looks);
  const bool is_other = cv::countNonZero(parts != counts.parts) > 0;
  counts.parts = parts;
  return is_other;
}

cv::Mat StillParts::shown(int margin_px) const {
  const Counts& counts = *counts_;
  if (counts.parts.empty()) return {};
  cv::Mat still;
  cv::resize(counts.parts, still, counts.size, 0.0, 0.0, cv::INTER_NEAREST);
  const int side = 2 * margin_px + 1;
  cv::dilate(still, still, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  return still == 0;
}

double StillParts::still_share() const {
  const cv::Mat& parts = counts_->parts;
  return parts.empty() ? 0.0 : cv::countNonZero(parts) / static_cast<double>(parts.total());
}

}  // namespace alidade
