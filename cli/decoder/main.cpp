// alidade_video FILE: writes a video's frames as grey values to standard output, for src/alidade/io/video_process.h:
// 64 characters "alidade_video WIDTH HEIGHT FRAMES", then for each frame 'f' and its bytes, and 'e' at the end.
// A program of its own, because OpenCV's videoio loads a hundred libraries that no other command needs.
#include <array>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

namespace {

/// As 8-bit grey; empty if it is not such a picture.
cv::Mat to_grey(const cv::Mat& frame) {
  cv::Mat grey;
  if (frame.depth() != CV_8U) return grey;
  if (frame.channels() == 1) return frame.clone();
  if (frame.channels() == 3) cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

bool write_header(const cv::Mat& grey, double frames) {
  std::array<char, 64> header{};
  const unsigned long count = frames > 0.0 && frames < 1e9 ? static_cast<unsigned long>(frames) : 0UL;
  std::snprintf(header.data(), header.size(), "alidade_video %d %d %lu", grey.cols, grey.rows, count);
  return std::fwrite(header.data(), 1, header.size(), stdout) == header.size();
}

int decode(const char* file) {
  cv::VideoCapture video(file, cv::CAP_FFMPEG);  // others would take a picture for the first of many
  cv::Mat frame, grey;
  if (!video.isOpened() || !video.read(frame)) return 3;
  grey = to_grey(frame);
  const cv::Size size = grey.size();
  if (grey.empty() || !write_header(grey, video.get(cv::CAP_PROP_FRAME_COUNT))) return 3;
  do {
    grey = to_grey(frame);
    if (grey.size() != size) return 3;
    std::fputc('f', stdout);
    const std::size_t bytes = grey.total();
    if (std::fwrite(grey.data, 1, bytes, stdout) != bytes) return 3;
  } while (video.read(frame));
  std::fputc('e', stdout);
  return std::fflush(stdout) == 0 ? 0 : 3;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    return decode(argv[1]);
  } catch (const std::exception&) {
    return 3;  // the reader says what it means
  }
}
