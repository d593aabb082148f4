#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

namespace cv {
class Mat;
}

namespace alidade {

enum class FrameColour { grey, bgr };

/// Called if a folder has no further image, or its newest one is incomplete. Returns true, after a while, to look
/// again, or false at the end.
using MoreImages = std::function<bool()>;

/// Frames of a video, one after the other: from a folder of numbered images, or from a file.
class VideoFrames {
 public:
  /// With `more`, a folder may still be filled, in order of its names, and be empty at first. Throws InputError for a
  /// missing file, a folder without images, a file that is not a video, or `more` with a file.
  explicit VideoFrames(const std::filesystem::path& file_or_folder, FrameColour colour = FrameColour::grey,
                       MoreImages more = {});
  VideoFrames(VideoFrames&&) noexcept;
  VideoFrames& operator=(VideoFrames&&) noexcept;
  ~VideoFrames();

  /// The next frame. Grey: 8 bits, or 32-bit float from 0 to 255 if the image has more. BGR: 8 bits with three
  /// channels, or one if the image is grey. Empty at the end. Throws InputError if it is not an image, truncated, of
  /// another size than the first, or too small to track points in; if more may come, also for an image that sorts
  /// before one already returned, no image at the end, or a name that changes how images are numbered.
  [[nodiscard]] cv::Mat next();

  /// Number of the frame that next() returned, starting at 0: images missing from a folder leave a gap. If not all
  /// names end in a number of up to nine digits, images are counted.
  [[nodiscard]] std::size_t number() const;
  /// Its time by the video's own clock [s]; NaN: the video has none, or it is a folder.
  [[nodiscard]] double time_s() const;
  /// Total number of frames, for progress reports; 0: not known, for example because more may come.
  [[nodiscard]] std::size_t num_frames() const;
  /// File or folder, with which messages begin.
  [[nodiscard]] const std::string& name() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace alidade
