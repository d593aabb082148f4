#include "alidade/heads/streams/frame_follower.h"

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/board_detector/find_board.h"

namespace alidade {
namespace {

cv::Mat grey_of(const cv::Mat& image) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

}  // namespace

FrameFollower::~FrameFollower() {
  {
    const std::scoped_lock lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  worker_.join();
}

void FrameFollower::push(StreamFrame frame) {
  if (frame.times != FrameTimes::arrival) stamps_.add(frame.t_s, frame.came_s);
  {
    const std::scoped_lock lock(mutex_);
    times_ = frame.times;
    sigma_s_ = frame.sigma_s;
    arrivals_.push_back({frame.t_s, frame.came_s, stamps_.piece(), stamps_.came_in_turn()});
    waiting_.push_back({std::move(frame), arrivals_.size() - 1});
  }
  changed_.notify_all();
}

/// Stamps that jump still show how far frames are apart, between two jumps.
std::vector<SeenFrame> FrameFollower::timed() const {
  std::vector<SeenFrame> frames = seen_;
  if (!stamps_.is_jumping()) return frames;
  const PiecedTimes times = pieced_times(arrivals_);
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].t_s = times.t_s[numbers_[i]];
  std::erase_if(frames, [](const SeenFrame& frame) { return std::isnan(frame.t_s); });
  return frames;
}

double FrameFollower::sigma_s() const { return stamps_.is_jumping() ? pieced_times(arrivals_).sigma_s : sigma_s_; }

std::vector<SeenFrame> FrameFollower::seen() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return waiting_.empty() && !is_busy_; });
  return timed();
}

std::vector<SeenFrame> FrameFollower::seen_so_far() {
  const std::scoped_lock lock(mutex_);
  return timed();
}

std::size_t FrameFollower::num_skipped() {
  const std::scoped_lock lock(mutex_);
  return num_skipped_;
}

void FrameFollower::skip_what_is_late() {
  constexpr double behind_s = 0.3;  // what a network sends in one piece is no delay
  if (keeps_all_ || waiting_.back().frame.came_s - waiting_.front().frame.came_s < behind_s) return;
  num_skipped_ += waiting_.size() - 1;
  waiting_.erase(waiting_.begin(), waiting_.end() - 1);
}

/// Of a board all corners or none, by their numbers: of a part nobody could say which they are.
std::vector<TrackedPoint> FrameFollower::points_in(const cv::Mat& grey) {
  if (!board_) return tracker_.update(grey);
  std::vector<TrackedPoint> points;
  for (const Corner& corner : find_board(grey, *board_, true).view.corners)
    points.push_back({corner.index, corner.px, std::sqrt(0.5 * corner.cov.trace())});
  return points;
}

void FrameFollower::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ends_ || !waiting_.empty(); });
    if (ends_) return;
    skip_what_is_late();
    const Waiting next = std::move(waiting_.front());
    waiting_.pop_front();
    is_busy_ = true;
    lock.unlock();
    SeenFrame seen{next.frame.t_s, points_in(grey_of(*next.frame.image))};
    lock.lock();
    is_busy_ = false;
    seen_.push_back(std::move(seen));
    numbers_.push_back(next.number);
    changed_.notify_all();
  }
}

}  // namespace alidade
