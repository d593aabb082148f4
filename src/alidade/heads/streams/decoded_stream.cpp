#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/heads/streams/arrival_times.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/heads/streams/waiting_frames.h"
#include "alidade/images/video_process.h"

namespace alidade {
namespace {

/// The decoder, read by a thread of its own. When a frame was taken: as the kernel of a camera or RTCP's sender says,
/// where the machines' clocks agree within an hour; else by the stream's own clock and the fastest arrivals.
class DecodedStream final : public FrameStream {
 public:
  DecodedStream(std::string url, const std::string& password, std::shared_ptr<HeadClock> clock)
      : name_(std::move(url)), address_{name_, password}, clock_(std::move(clock)) {
    begin();
    reader_ = std::thread([this] { read(); });
  }
  ~DecodedStream() override {
    ends_ = true;
    {
      const std::scoped_lock lock(mutex_);
      if (video_) video_->interrupt();
    }
    reader_.join();
  }
  DecodedStream(const DecodedStream&) = delete;
  DecodedStream& operator=(const DecodedStream&) = delete;

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::deque<StreamFrame> take() override { return frames_.take(); }

 private:
  void begin() {
    (void)with_secret(name_, address_.password);  // the decoder puts it there; here it is seen whether there is one
    auto video = std::make_unique<VideoProcess>(address_, FrameColour::bgr);
    const std::scoped_lock lock(mutex_);
    video_ = std::move(video);
  }

  [[nodiscard]] StreamFrame frame_of(std::vector<unsigned char> bytes, double now_s) {
    auto image = std::make_shared<cv::Mat>(video_->height_px(), video_->width_px(), CV_8UC3);
    std::copy(bytes.begin(), bytes.end(), image->data);
    const FrameTime& time = video_->time();
    constexpr double max_apart_s = 3600.0;
    const bool is_given = std::isfinite(time.taken_s) && std::abs(time.taken_s - now_s) < max_apart_s;
    const bool is_device = name_.starts_with("v4l2:");
    const FilteredTime filtered =
        arrivals_.add(now_s, std::isfinite(time.media_s) ? std::optional(time.media_s) : std::nullopt);
    if (!is_given) return {filtered.t_s, FrameTimes::arrival, filtered.sigma_s, now_s, std::move(image)};
    return {time.taken_s, is_device ? FrameTimes::stamped : FrameTimes::sender, 0.0, now_s, std::move(image)};
  }

  void read() {
    while (!ends_) {
      std::string fault = "has ended";
      try {
        std::vector<unsigned char> bytes = video_->next();
        const double now_s = clock_->now_s();
        if (!bytes.empty()) {
          frames_.add(frame_of(std::move(bytes), now_s));
          continue;
        }
      } catch (const InputError&) {
        fault = "broke off";
      }
      if (connects_again()) continue;
      return frames_.end(name_ + ": " + fault + "; the stream is lost");
    }
  }

  bool connects_again() {
    return begins_again(ends_, [this] {
      arrivals_ = {};
      if (!ends_) begin();
    });
  }

  std::string name_;
  StreamAddress address_;
  std::shared_ptr<HeadClock> clock_;
  std::mutex mutex_;
  std::unique_ptr<VideoProcess> video_;
  ArrivalTimes arrivals_;
  WaitingFrames frames_{200};
  std::atomic<bool> ends_ = false;
  std::thread reader_;
};

}  // namespace

std::unique_ptr<FrameStream> open_decoded(const std::string& url, const std::string& password,
                                          std::shared_ptr<HeadClock> clock) {
  return std::make_unique<DecodedStream>(url, password, std::move(clock));
}

}  // namespace alidade
