#include "alidade/live/capture/newest_frame.h"

#include <atomic>
#include <mutex>
#include <thread>
#include <utility>

#include "alidade/files/files.h"
#include "alidade/images/video_process.h"

namespace alidade::live {

struct NewestFrame::State {
  explicit State(const std::string& address) : video(StreamAddress{address}, FrameColour::grey) {}

  VideoProcess video;
  mutable std::mutex mutex;
  std::optional<LiveFrame> newest;
  std::atomic<bool> is_over{false}, is_wanted{true};
  std::thread thread;

  void read() {
    try {
      while (is_wanted) {
        std::vector<unsigned char> grey = video.next();
        if (grey.empty()) break;
        const std::scoped_lock lock(mutex);
        newest = LiveFrame{video.width_px(), video.height_px(), std::move(grey)};
      }
    } catch (const InputError&) {  // it broke off: over
    }
    is_over = true;
  }
};

NewestFrame::NewestFrame(const std::string& address) : state_(std::make_unique<State>(address)) {
  state_->thread = std::thread([&state = *state_] { state.read(); });
}

NewestFrame::~NewestFrame() {
  state_->is_wanted = false;
  state_->video.interrupt();
  state_->thread.join();
}

std::optional<LiveFrame> NewestFrame::fetch() {
  const std::scoped_lock lock(state_->mutex);
  return std::exchange(state_->newest, std::nullopt);
}

bool NewestFrame::is_over() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->is_over && !state_->newest;
}

}  // namespace alidade::live
