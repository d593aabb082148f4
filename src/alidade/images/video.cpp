#include "alidade/images/video.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "alidade/description/natural_order.h"
#include "alidade/files/files.h"
#include "alidade/images/photos.h"
#include "alidade/images/video_process.h"

namespace alidade {
namespace {

constexpr int min_side_px = 64;  // less has no room for a handful of patches

/// "frame_0012.png" is 12.
std::optional<std::size_t> number_in(const std::filesystem::path& image) {
  constexpr std::size_t max_digits = 9;  // more are clocks, not counts
  const std::string name = image.stem().string();
  const std::size_t last = name.find_last_of("0123456789");
  if (last == std::string::npos) return std::nullopt;
  const std::size_t before = name.find_last_not_of("0123456789", last);
  const std::string digits = name.substr(before == std::string::npos ? 0 : before + 1, last - before);
  if (digits.size() > max_digits) return std::nullopt;
  return std::stoul(digits);
}

/// Numbers of the frames from 0: those in the names if all have one and they grow, else their count.
std::vector<std::size_t> numbers_of(const std::vector<std::filesystem::path>& images) {
  std::vector<std::size_t> counted(images.size()), named;
  for (std::size_t i = 0; i < images.size(); ++i) {
    counted[i] = i;
    const std::optional<std::size_t> number = number_in(images[i]);
    if (number && (named.empty() || *number > named.back())) named.push_back(*number);
  }
  if (named.size() < images.size()) return counted;
  for (std::size_t i = named.size(); i-- > 0;) named[i] -= named[0];
  return named;
}

cv::Mat in_colours(const cv::Mat& photo, FrameColour colour) {
  const bool is_bgr = colour == FrameColour::bgr;
  cv::Mat frame = photo;
  if (photo.channels() == 3 && !is_bgr) cv::cvtColor(photo, frame, cv::COLOR_BGR2GRAY);
  if (photo.channels() == 4) cv::cvtColor(photo, frame, is_bgr ? cv::COLOR_BGRA2BGR : cv::COLOR_BGRA2GRAY);
  return frame;
}

}  // namespace

class VideoFrames::Impl {
 public:
  Impl(const std::filesystem::path& path, FrameColour colour, MoreImages more)
      : name(path.string()), colour_(colour), more_(std::move(more)) {
    std::error_code error;
    if (!std::filesystem::exists(path, error)) throw InputError(name + ": no such file or folder");
    const bool is_folder = std::filesystem::is_directory(path, error);
    if (more_) {
      if (!is_folder) throw InputError(name + ": only a folder of numbered images can be waited for");
    } else if (is_folder) {
      images_ = list_photos({path});
      numbers_ = numbers_of(images_);
      num_frames = images_.size();
    } else {
      process_.emplace(path, colour);
      num_frames = process_->num_frames();
    }
  }

  cv::Mat next() {
    cv::Mat frame = process_ ? decoded() : more_ ? awaited() : read();
    if (frame.empty()) return frame;
    const std::string where = process_ ? name : images_[count_].string();
    if (size_.empty()) size_ = frame.size();
    if (frame.size() != size_)
      throw InputError(fmt::format("{}: is {}×{}, the first frame is {}×{}; one video has one size", where, frame.cols,
                                   frame.rows, size_.width, size_.height));
    if (std::min(frame.rows, frame.cols) < min_side_px)
      throw InputError(fmt::format("{}: is {}×{}; points are followed in {} pixels a side or more", where, frame.cols,
                                   frame.rows, min_side_px));
    number = process_ ? count_ : numbers_[count_];
    ++count_;
    return frame;
  }

  [[nodiscard]] double time_s() const {
    return process_ ? process_->time().media_s : std::numeric_limits<double>::quiet_NaN();
  }

  std::string name;
  std::size_t number = 0, num_frames = 0;

 private:
  cv::Mat decoded() {
    std::vector<unsigned char> bytes = process_->next();
    if (bytes.empty()) return {};
    const int type = colour_ == FrameColour::bgr ? CV_8UC3 : CV_8UC1;
    return cv::Mat(process_->height_px(), process_->width_px(), type, bytes.data()).clone();
  }

  /// The next image of a folder that may still be filled, as soon as it is whole.
  cv::Mat awaited() {
    while (true) {
      if (count_ == images_.size() && !look_again()) {
        if (more_()) continue;
        if (count_ == 0) images_ = list_photos({name});  // says what lies there instead
        return {};
      }
      const bool was_newest = count_ + 1 == images_.size();
      try {
        return read();
      } catch (const InputError&) {
        // Whole when the next one is there; and that was perhaps written since.
        if (!was_newest || (!look_again() && !more_())) throw;
      }
    }
  }

  /// Lists the folder; whether it has images that were not listed.
  bool look_again() {
    std::vector<std::filesystem::path> there;
    try {
      there = list_photos({name});
    } catch (const InputError&) {
      return false;  // none, or not now
    }
    const auto next = images_.begin() + static_cast<std::ptrdiff_t>(count_);
    const std::vector<std::filesystem::path> given(images_.begin(), next);
    std::vector<std::filesystem::path> listed = given;
    for (const std::filesystem::path& image : there) {
      if (given.empty() || natural_less(given.back().string(), image.string()))
        listed.push_back(image);
      else if (std::ranges::find(given, image) == given.end())
        throw InputError(fmt::format("{}: came after {}; images must come in order", image.string(),
                                     given.back().filename().string()));
    }
    const bool has_new = listed.size() > images_.size();
    const std::vector<std::size_t> numbers = numbers_of(listed);
    if (!given.empty() && numbers[count_ - 1] != number)
      throw InputError(fmt::format("{}: has images without a number of their own behind {}, which had one", name,
                                   given.back().filename().string()));
    images_ = std::move(listed);
    numbers_ = numbers;
    return has_new;
  }

  cv::Mat read() {
    if (count_ == images_.size()) return {};
    try {
      return to_frame(in_colours(decode_photo(read_file(images_[count_])), colour_));
    } catch (const InputError& error) {
      const std::string what = error.what(), file = images_[count_].string();
      throw InputError(what.starts_with(file) ? what : file + ": " + what);
    }
  }

  /// Deep images become float, divided by the same for all frames: as required by the first one's bits, as 10- and
  /// 12-bit cameras store their values in 16.
  cv::Mat to_frame(const cv::Mat& image) {
    if (image.depth() == CV_8U) return image;
    cv::Mat frame;
    if (count_ == 0) {
      double brightest = 0.0;
      cv::minMaxLoc(image.reshape(1), nullptr, &brightest);
      while (full_scale_ < brightest) full_scale_ = 2.0 * full_scale_ + 1.0;
    }
    image.convertTo(frame, CV_32F, 255.0 / full_scale_);
    cv::patchNaNs(frame, 0.0);
    if (colour_ == FrameColour::bgr) frame.convertTo(frame, CV_8U);
    return frame;
  }

  FrameColour colour_;
  MoreImages more_;
  std::vector<std::filesystem::path> images_;
  std::vector<std::size_t> numbers_;
  std::optional<VideoProcess> process_;
  std::size_t count_ = 0;
  cv::Size size_;
  double full_scale_ = 255.0;
};

VideoFrames::VideoFrames(const std::filesystem::path& file_or_folder, FrameColour colour, MoreImages more)
    : impl_(std::make_unique<Impl>(file_or_folder, colour, std::move(more))) {}
VideoFrames::VideoFrames(VideoFrames&&) noexcept = default;
VideoFrames& VideoFrames::operator=(VideoFrames&&) noexcept = default;
VideoFrames::~VideoFrames() = default;

cv::Mat VideoFrames::next() { return impl_->next(); }
std::size_t VideoFrames::number() const { return impl_->number; }
double VideoFrames::time_s() const { return impl_->time_s(); }
std::size_t VideoFrames::num_frames() const { return impl_->num_frames; }
const std::string& VideoFrames::name() const { return impl_->name; }

}  // namespace alidade
