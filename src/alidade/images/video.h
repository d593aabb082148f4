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

/// Asked where a folder has no further image, or its newest one is not yet whole. True, after a while: look again.
/// False: that was all.
using MoreImages = std::function<bool()>;

/// Frames of a video, one after the other: of a folder of numbered images, or of a file.
class VideoFrames {
 public:
  /// With `more` a folder may still be filled, in order of its names, and be empty at first. Throws InputError: no
  /// such file, no images in the folder, not a video; `more` of a file.
  explicit VideoFrames(const std::filesystem::path& file_or_folder, FrameColour colour = FrameColour::grey,
                       MoreImages more = {});
  VideoFrames(VideoFrames&&) noexcept;
  VideoFrames& operator=(VideoFrames&&) noexcept;
  ~VideoFrames();

  /// The next frame. Grey: 8 bits, or 32-bit float of 0 to 255 where the image has more. BGR: 8 bits, of three
  /// channels, or of one where the image is grey. Empty at the end. Throws InputError: not an image, cut off,
  /// another size than the first, too small to follow points in; where more may come, an image that sorts before one
  /// that was given, none at the end, or a name that changes how images are numbered.
  [[nodiscard]] cv::Mat next();

  /// Number of the frame that next() gave, the first 0: images that are missing from a folder leave a gap. Where not
  /// all names end in a number of up to nine digits, images are counted.
  [[nodiscard]] std::size_t number() const;
  /// Its time by the video's own clock [s]; NaN: the video has none, or it is a folder.
  [[nodiscard]] double time_s() const;
  /// How many there will be; 0: not known, as where more may come. For showing progress.
  [[nodiscard]] std::size_t num_frames() const;
  /// File or folder, to begin a message with.
  [[nodiscard]] const std::string& name() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace alidade
