#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/line_socket.h"
#include "alidade/heads/protocols/soap.h"
#include "alidade/heads/streams/arrival_times.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/heads/streams/waiting_frames.h"
#include "alidade/imaging/image_codecs.h"

namespace alidade {
namespace {

constexpr double first_timeout_s = 5.0;  // until the first frame
constexpr std::size_t max_bytes = 1 << 24;

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

class MjpegStream final : public FrameStream {
 public:
  MjpegStream(const std::string& url, std::string password, std::shared_ptr<HeadClock> clock)
      : name_(url),
        password_(std::move(password)),
        clock_(std::move(clock)),
        socket_(address_of(url, "http://", 80), first_timeout_s) {
    begin();
    frames_.add(next());
    reader_ = std::thread([this] { read(); });
  }
  ~MjpegStream() override {
    ends_ = true;
    reader_.join();
  }
  MjpegStream(const MjpegStream&) = delete;
  MjpegStream& operator=(const MjpegStream&) = delete;

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::deque<StreamFrame> take() override { return frames_.take(); }

 private:
  void begin() {
    socket_.connect();
    const std::size_t slash = name_.find('/', std::string_view("http://").size());
    const std::string path = slash == std::string::npos ? "/" : with_secret(name_.substr(slash), password_);
    const std::string& user = socket_.address().user;
    const std::string login =
        user.empty() ? "" : "Authorization: Basic " + base64_text(user + ":" + password_) + "\r\n";
    // 1.0: the answer comes in one piece, not in chunks.
    socket_.write(
        fmt::format("GET {} HTTP/1.0\r\nHost: {}:{}\r\n{}Accept: multipart/x-mixed-replace, image/jpeg\r\n\r\n", path,
                    socket_.address().host, socket_.address().port, login));
    const std::string status = socket_.line();
    if (status.find(" 200") == std::string::npos)
      throw InputError(fmt::format("{}: answers '{}'", name_, status.substr(0, 60)));
    bool is_multipart = false;
    for (std::string line = socket_.line(); !line.empty(); line = socket_.line())
      is_multipart = is_multipart || lower(line).starts_with("content-type: multipart/x-mixed-replace");
    if (!is_multipart) throw InputError(name_ + ": is no stream of JPEG images (multipart/x-mixed-replace)");
  }

  /// Waits for the next one, at most the socket's timeout.
  StreamFrame next() {
    std::optional<std::size_t> length;
    std::optional<double> stamp;
    bool has_header = false;
    for (;;) {
      const std::string line = lower(socket_.line());
      if (line.empty() && has_header) break;
      if (line.empty() || line.starts_with("--")) continue;
      has_header = true;
      if (line.starts_with("content-length:")) length = std::strtoul(line.c_str() + 15, nullptr, 10);
      if (line.starts_with("x-timestamp:")) stamp = std::strtod(line.c_str() + 12, nullptr);
    }
    if (!length || *length == 0 || *length > max_bytes)
      throw InputError(name_ + ": a part of the stream does not say how long it is");
    const std::string jpeg = socket_.bytes(*length);
    const double now_s = clock_->now_s();
    const cv::Mat image = decode_image(jpeg);
    if (image.empty() || image.depth() != CV_8U) throw InputError(name_ + ": a part of the stream is no JPEG");
    const bool is_stamped = stamp && std::isfinite(*stamp) && std::abs(*stamp - now_s) < 3600.0;
    const FilteredTime filtered = arrivals_.add(now_s);
    auto kept = std::make_shared<const cv::Mat>(image);
    if (is_stamped) return {*stamp, FrameTimes::stamped, 0.0, now_s, std::move(kept)};
    return {filtered.t_s, FrameTimes::arrival, filtered.sigma_s, now_s, std::move(kept)};
  }

  void read() {
    constexpr double silence_s = 1.0;
    socket_.set_timeout(silence_s);
    while (!ends_) {
      try {
        frames_.add(next());
      } catch (const InputError& error) {
        if (connects_again()) continue;
        return frames_.end(std::string(error.what()) + "; the stream is lost");
      }
    }
  }

  bool connects_again() {
    return begins_again(ends_, [this] {
      socket_.close();
      arrivals_ = {};
      begin();
    });
  }

  std::string name_, password_;
  std::shared_ptr<HeadClock> clock_;
  LineSocket socket_;
  ArrivalTimes arrivals_;
  WaitingFrames frames_{200};
  std::atomic<bool> ends_ = false;
  std::thread reader_;
};

}  // namespace

std::unique_ptr<FrameStream> open_mjpeg(const std::string& url, const std::string& password,
                                        std::shared_ptr<HeadClock> clock) {
  return std::make_unique<MjpegStream>(url, password, std::move(clock));
}

}  // namespace alidade
