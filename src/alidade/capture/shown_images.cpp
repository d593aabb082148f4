#include "alidade/capture/shown_images.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "alidade/capture/pose_plan.h"

namespace alidade {
namespace {

constexpr std::size_t max_images = 24, min_images = 4;
constexpr std::size_t max_bytes = 64u << 20;  // of all of them
constexpr double alike_share = 0.04;          // of the board's size, as of photos that are kept

/// So many images of that size are kept.
std::size_t max_count(const cv::Mat* image) {
  if (image == nullptr || image->empty()) return max_images;
  return std::clamp(max_bytes / (image->total() * image->elemSize()), min_images, max_images);
}

}  // namespace

void ShownImages::offer(const BoardView& view, const cv::Mat* image, double t_s, double gain) {
  if (std::ranges::any_of(shown_, [&](const ShownImage& one) { return is_same_pose(view, one.view, alike_share); }))
    return;
  const auto least = std::ranges::min_element(shown_, {}, &ShownImage::gain);
  const bool is_full = shown_.size() >= max_count(image);
  if (is_full && gain <= least->gain) return;
  ShownImage made{.view = view, .image = nullptr, .t_s = t_s, .gain = gain};
  if (image != nullptr) made.image = std::make_shared<const cv::Mat>(image->clone());
  if (is_full) {
    *least = std::move(made);
  } else {
    shown_.push_back(std::move(made));
  }
}

void ShownImages::value(const std::function<double(const BoardView&)>& gain_of,
                        const std::function<bool(const BoardView&)>& is_kept) {
  std::erase_if(shown_, [&](const ShownImage& one) { return is_kept(one.view); });
  for (ShownImage& one : shown_) one.gain = gain_of(one.view);
}

void ShownImages::drop(const cv::Mat& image) {
  std::erase_if(shown_, [&](const ShownImage& one) { return one.image && one.image->data == image.data; });
}

const ShownImage* ShownImages::best() const {
  const auto best = std::ranges::max_element(shown_, {}, &ShownImage::gain);
  return best == shown_.end() ? nullptr : &*best;
}

}  // namespace alidade
