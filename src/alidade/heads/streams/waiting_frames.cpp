#include "alidade/heads/streams/waiting_frames.h"

#include <chrono>
#include <thread>
#include <utility>

#include "alidade/files/files.h"

namespace alidade {

void WaitingFrames::add(StreamFrame frame) {
  const std::scoped_lock lock(mutex_);
  frames_.push_back(std::move(frame));
  if (frames_.size() > most_) frames_.pop_front();
}

void WaitingFrames::end(std::string fault) {
  const std::scoped_lock lock(mutex_);
  fault_ = std::move(fault);
}

std::deque<StreamFrame> WaitingFrames::take() {
  const std::scoped_lock lock(mutex_);
  if (!fault_.empty() && frames_.empty()) throw InputError(fault_);
  return std::exchange(frames_, {});
}

bool begins_again(const std::atomic<bool>& ends, const std::function<void()>& begin) {
  constexpr int tries = 5, first_pause_ms = 200;
  for (int i = 0; i < tries && !ends; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(first_pause_ms << i));
    try {
      begin();
      return true;
    } catch (const InputError&) {  // not yet
    }
  }
  return false;
}

}  // namespace alidade
