#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/indi_link.h"
#include "alidade/heads/protocols/soap.h"
#include "alidade/heads/streams/fits_image.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/heads/streams/waiting_frames.h"

namespace alidade {
namespace {

constexpr double timeout_s = 5.0;

/// "?seconds=0.5" of the address.
double seconds_of(const std::string& url) {
  const std::size_t query = url.find('?');
  if (query == std::string::npos) return 1.0;
  constexpr std::string_view key = "?seconds=";
  const std::string text = url.substr(query);
  char* end = nullptr;
  const double seconds = text.starts_with(key) ? std::strtod(text.c_str() + key.size(), &end) : 0.0;
  if (!(seconds > 0.0 && seconds <= 60.0) || end == nullptr || *end != '\0')
    throw InputError(url + ": the camera's name may be followed by ?seconds=S, an exposure of at most 60 s");
  return seconds;
}

/// Exposes one image after the other, on a thread of its own. An image's time is the midpoint of its exposure, as the
/// server's clock has it.
class IndiCamera final : public FrameStream {
 public:
  IndiCamera(const std::string& url, std::shared_ptr<HeadClock> clock)
      : seconds_(seconds_of(url)), clock_(std::move(clock)), link_(url, timeout_s) {
    begin();
    reader_ = std::thread([this] { read(); });
  }
  ~IndiCamera() override {
    ends_ = true;
    reader_.join();
  }
  IndiCamera(const IndiCamera&) = delete;
  IndiCamera& operator=(const IndiCamera&) = delete;

  [[nodiscard]] const std::string& name() const override { return link_.name(); }
  [[nodiscard]] double exposure_s() const override { return seconds_; }
  [[nodiscard]] std::deque<StreamFrame> take() override { return frames_.take(); }

 private:
  static constexpr const char* exposure = "CCD_EXPOSURE";

  void begin() {
    link_.connect_device(timeout_s);
    (void)link_.wait_for(exposure, timeout_s);
    link_.take(0.3);
    for (const auto& [property, on] :
         {std::pair("UPLOAD_MODE", "UPLOAD_CLIENT"), std::pair("CCD_TRANSFER_FORMAT", "FORMAT_FITS"),
          std::pair("CCD_COMPRESSION", "INDI_DISABLED")})
      if (const IndiProperty* found = link_.find(property); found != nullptr && found->values.contains(on))
        link_.set_switch(property, on);
    link_.send(fmt::format("<enableBLOB device=\"{}\">Also</enableBLOB>\n", escaped_xml(link_.device())));
  }

  void read() {
    while (!ends_) {
      try {
        std::optional<StreamFrame> frame = expose();
        if (!frame) return;
        frames_.add(*std::move(frame));
      } catch (const InputError& error) {
        if (connects_again()) continue;
        return frames_.end(std::string(error.what()) + "; the stream is lost");
      }
    }
  }

  /// None: this ends.
  std::optional<StreamFrame> expose() {
    constexpr double step_s = 0.05, download_s = 20.0;
    const std::size_t before = num_blobs();
    link_.set_numbers(exposure, {{"CCD_EXPOSURE_VALUE", seconds_}});
    for (const double until_s = clock_->now_s() + seconds_ + download_s; clock_->now_s() < until_s;) {
      if (ends_) return std::nullopt;
      link_.take(step_s);
      if (num_blobs() > before) return frame_of(*link_.find("CCD1"));
      if (const IndiProperty* state = link_.find(exposure); state != nullptr && state->state == "Alert")
        throw InputError(fmt::format("{}: '{}' does not expose (Alert)", name(), link_.device()));
    }
    throw InputError(fmt::format("{}: no image within {:g} s", name(), seconds_ + download_s));
  }
  /// That came with bytes: the property's definition has none.
  [[nodiscard]] std::size_t num_blobs() const {
    const IndiProperty* found = link_.find("CCD1");
    return found == nullptr || found->format.empty() ? 0 : found->count;
  }

  [[nodiscard]] StreamFrame frame_of(const IndiProperty& blob) const {
    constexpr double max_apart_s = 3600.0;
    if (blob.format != ".fits")
      throw InputError(fmt::format("{}: sends images as {}; let '{}' send FITS, not compressed", name(), blob.format,
                                   link_.device()));
    std::string text;
    for (const auto& [member, value] : blob.values) text = value;
    const FitsImage image = read_fits(base64_bytes(text), name());
    const double exposed_s = std::isfinite(image.exposure_s) ? image.exposure_s : seconds_;
    auto grey = std::make_shared<const cv::Mat>(stretched_to_grey(image));
    const double stamp_s = image.begin_s + 0.5 * exposed_s;
    if (std::isfinite(stamp_s) && std::abs(stamp_s - blob.t_s) < max_apart_s)
      return {stamp_s, FrameTimes::stamped, 0.0, blob.t_s, std::move(grey)};
    return {blob.t_s - 0.5 * exposed_s, FrameTimes::arrival, 0.1, blob.t_s, std::move(grey)};
  }

  bool connects_again() {
    return begins_again(ends_, [this] {
      link_.connect_again();
      begin();
    });
  }

  double seconds_;
  std::shared_ptr<HeadClock> clock_;
  IndiLink link_;
  WaitingFrames frames_{20};
  std::atomic<bool> ends_ = false;
  std::thread reader_;
};

}  // namespace

std::unique_ptr<FrameStream> open_indi_camera(const std::string& url, std::shared_ptr<HeadClock> clock) {
  return std::make_unique<IndiCamera>(url, std::move(clock));
}

}  // namespace alidade
