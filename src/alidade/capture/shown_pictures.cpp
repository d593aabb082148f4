#include "alidade/capture/shown_pictures.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "alidade/capture/pose_plan.h"

namespace alidade {
namespace {

constexpr std::size_t max_pictures = 24, min_pictures = 4;
constexpr std::size_t max_bytes = 64u << 20;  // of all of them
constexpr double alike_share = 0.04;          // of the board's size, as of photos that are kept

/// So many pictures of that size are held.
std::size_t max_count(const cv::Mat* picture) {
  if (picture == nullptr || picture->empty()) return max_pictures;
  return std::clamp(max_bytes / (picture->total() * picture->elemSize()), min_pictures, max_pictures);
}

}  // namespace

void ShownPictures::offer(const BoardView& view, const cv::Mat* picture, double t_s, double gain) {
  if (std::ranges::any_of(shown_, [&](const ShownPicture& one) { return is_same_pose(view, one.view, alike_share); }))
    return;
  const auto least = std::ranges::min_element(shown_, {}, &ShownPicture::gain);
  const bool is_full = shown_.size() >= max_count(picture);
  if (is_full && gain <= least->gain) return;
  ShownPicture made{.view = view, .picture = nullptr, .t_s = t_s, .gain = gain};
  if (picture != nullptr) made.picture = std::make_shared<const cv::Mat>(picture->clone());
  if (is_full) {
    *least = std::move(made);
  } else {
    shown_.push_back(std::move(made));
  }
}

void ShownPictures::value(const std::function<double(const BoardView&)>& gain_of,
                          const std::function<bool(const BoardView&)>& is_kept) {
  std::erase_if(shown_, [&](const ShownPicture& one) { return is_kept(one.view); });
  for (ShownPicture& one : shown_) one.gain = gain_of(one.view);
}

void ShownPictures::drop(const cv::Mat& picture) {
  std::erase_if(shown_, [&](const ShownPicture& one) { return one.picture && one.picture->data == picture.data; });
}

const ShownPicture* ShownPictures::best() const {
  const auto best = std::ranges::max_element(shown_, {}, &ShownPicture::gain);
  return best == shown_.end() ? nullptr : &*best;
}

}  // namespace alidade
