#include "alidade/heads/streams/frame_follower.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

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
  const FilteredTime came = arrivals_.add(frame.came_s);
  if (frame.times != FrameTimes::arrival) stamps_.add(frame.t_s, frame.came_s);
  {
    const std::scoped_lock lock(mutex_);
    times_ = frame.times;
    sigma_s_ = frame.sigma_s;
    arrival_sigma_s_ = came.sigma_s;
    waiting_came_s_.push_back(came.t_s);
    waiting_.push_back(std::move(frame));
  }
  changed_.notify_all();
}

std::vector<SeenFrame> FrameFollower::timed() const {
  std::vector<SeenFrame> frames = seen_;
  if (!stamps_.is_jumping()) return frames;
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].t_s = came_s_[i];
  return frames;
}

std::vector<SeenFrame> FrameFollower::seen() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return waiting_.empty() && !is_busy_; });
  return timed();
}

std::vector<SeenFrame> FrameFollower::seen_so_far() {
  const std::scoped_lock lock(mutex_);
  return timed();
}

void FrameFollower::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ends_ || !waiting_.empty(); });
    if (ends_) return;
    const StreamFrame frame = std::move(waiting_.front());
    const double came_s = waiting_came_s_.front();
    waiting_.pop_front();
    waiting_came_s_.pop_front();
    is_busy_ = true;
    lock.unlock();
    SeenFrame seen{frame.t_s, tracker_.update(grey_of(*frame.image))};
    lock.lock();
    is_busy_ = false;
    seen_.push_back(std::move(seen));
    came_s_.push_back(came_s);
    changed_.notify_all();
  }
}

}  // namespace alidade
