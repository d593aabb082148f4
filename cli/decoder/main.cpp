// alidade_video FILE|rtsp:…|http:…|v4l2:DEVICE grey|bgr: writes a video's frames to standard output, for
// src/alidade/images/video_process.h: 64 characters "alidade_video WIDTH HEIGHT FRAMES", then for each frame 'f' and
// its bytes, and 'e' at the end. A program of its own, because OpenCV's videoio loads a hundred libraries that no other
// command needs.
#include <array>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string_view>

namespace {

/// As 8-bit grey or BGR; empty if it is not such an image.
cv::Mat in_colours(const cv::Mat& frame, bool is_bgr) {
  cv::Mat result;
  if (frame.depth() != CV_8U) return result;
  if (frame.channels() == (is_bgr ? 3 : 1)) return frame.clone();
  if (frame.channels() == 3) cv::cvtColor(frame, result, cv::COLOR_BGR2GRAY);
  if (frame.channels() == 1) cv::cvtColor(frame, result, cv::COLOR_GRAY2BGR);
  return result;
}

bool write_header(const cv::Mat& image, double frames) {
  std::array<char, 64> header{};
  const unsigned long count = frames > 0.0 && frames < 1e9 ? static_cast<unsigned long>(frames) : 0UL;
  std::snprintf(header.data(), header.size(), "alidade_video %d %d %lu", image.cols, image.rows, count);
  return std::fwrite(header.data(), 1, header.size(), stdout) == header.size();
}

int decode(const char* file, bool is_bgr) {
  constexpr std::string_view device = "v4l2:";
  cv::VideoCapture video;
  if (std::string_view(file).substr(0, device.size()) == device) {
    video.open(file + device.size(), cv::CAP_V4L2);
  } else {
    video.open(file, cv::CAP_FFMPEG);  // others would take an image for the first of many
  }
  cv::Mat frame, image;
  if (!video.isOpened() || !video.read(frame)) return 3;
  image = in_colours(frame, is_bgr);
  const cv::Size size = image.size();
  if (image.empty() || !write_header(image, video.get(cv::CAP_PROP_FRAME_COUNT))) return 3;
  do {
    image = in_colours(frame, is_bgr);
    if (image.size() != size) return 3;
    std::fputc('f', stdout);
    const std::size_t bytes = image.total() * image.elemSize();
    if (std::fwrite(image.data, 1, bytes, stdout) != bytes) return 3;
  } while (video.read(frame));
  std::fputc('e', stdout);
  return std::fflush(stdout) == 0 ? 0 : 3;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    return decode(argv[1], std::string_view(argv[2]) == "bgr");
  } catch (const std::exception&) {
    return 3;  // the reader says what it means
  }
}
