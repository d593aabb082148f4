#pragma once

#include <atomic>
#include <functional>
#include <mutex>

#include "alidade/heads/streams/frame_stream.h"

namespace alidade {

/// Frames that a thread reads and another takes: at most so many wait, the newest.
class WaitingFrames {
 public:
  explicit WaitingFrames(std::size_t most) : most_(most) {}

  void add(StreamFrame frame);
  /// No more come. take() throws it as an InputError, once those that wait are taken.
  void end(std::string fault);
  [[nodiscard]] std::deque<StreamFrame> take();

 private:
  std::size_t most_;
  std::mutex mutex_;
  std::deque<StreamFrame> frames_;
  std::string fault_;
};

/// Tries five times, with growing pauses, until `begin` throws no InputError. False: it always did, or `ends`.
[[nodiscard]] bool begins_again(const std::atomic<bool>& ends, const std::function<void()>& begin);

}  // namespace alidade
