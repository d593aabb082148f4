#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "alidade/images/video.h"

namespace alidade {

/// A camera or an image server: "v4l2:/dev/video0", "rtsp://…", "http://…".
struct StreamAddress {
  std::string text;
  std::string password = {};  ///< The user's password; passed to the decoder by its environment, never in messages.
};

/// Time at which a frame was taken; NaN: not known.
struct FrameTime {
  double media_s = 0.0;  ///< By the video's own clock.
  double taken_s = 0.0;  ///< Since 1970: by the kernel for a camera, or by RTCP sender reports.
};
/// Whether a text is such an address, not a file or a folder.
[[nodiscard]] bool is_stream_address(const std::string& text);

/// Decodes a video file in a separate process, the program alidade_video next to this one: its libraries take longer to
/// load than most commands run, and a broken file cannot crash this program.
class VideoProcess {
 public:
  /// Starts the process. Throws InputError for a missing file, not a video, or no decoder.
  VideoProcess(const std::filesystem::path& video, FrameColour colour);
  /// Frames as they come from a camera or a server. Throws InputError if it provides none.
  VideoProcess(const StreamAddress& stream, FrameColour colour);
  VideoProcess(const VideoProcess&) = delete;
  VideoProcess& operator=(const VideoProcess&) = delete;
  ~VideoProcess();

  [[nodiscard]] int width_px() const { return width_px_; }
  [[nodiscard]] int height_px() const { return height_px_; }
  /// According to the file; 0: not stated.
  [[nodiscard]] std::size_t num_frames() const { return num_frames_; }

  /// The next frame's values, row-major (grey, or blue, green and red); empty at the end. Throws InputError if the
  /// decoder died.
  [[nodiscard]] std::vector<unsigned char> next();
  /// Time of the frame that next() returned.
  [[nodiscard]] const FrameTime& time() const { return time_; }
  /// Ends the decoder: a next() that waits in another thread throws as if it had died.
  void interrupt() const;

 private:
  void start(const std::string& source, const std::string& password);
  [[nodiscard]] bool read_bytes(void* to, std::size_t count) const;
  void read_header();
  void stop();

  std::filesystem::path video_;
  FrameColour colour_;
  bool is_stream_ = false;
  int pipe_ = -1, process_ = -1;
  int width_px_ = 0, height_px_ = 0;
  std::size_t num_frames_ = 0;
  FrameTime time_;
};

}  // namespace alidade
