// alidade_video FILE|rtsp:…|http:…|v4l2:DEVICE grey|bgr: writes a video's frames to standard output, for
// src/alidade/images/video_process.h: 64 characters "alidade_video WIDTH HEIGHT FRAMES", then for each frame 'f', two
// doubles (its time in the video, s; when it was taken, s since 1970; NaN: not known) and its bytes, and 'e' at the
// end. A program of its own: its libraries take longer to load than most commands run, and a broken file takes no other
// program with it. The password of a stream's user comes in ALIDADE_PASSWORD, not among the arguments, which all see.
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavdevice/avdevice.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libswscale/swscale.h>
}

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::string_view device_prefix = "v4l2:";

struct Times {
  double media_s = unknown, taken_s = unknown;
};

bool is_remote(std::string_view source) {
  return source.starts_with("rtsp://") || source.starts_with("http://") || source.starts_with("https://");
}

std::string percent_encoded(std::string_view text) {
  std::string encoded;
  for (const char letter : text) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '-' || letter == '_';
    std::array<char, 4> code{};
    std::snprintf(code.data(), code.size(), "%%%02X", static_cast<unsigned>(static_cast<unsigned char>(letter)));
    encoded += is_plain ? std::string(1, letter) : std::string(code.data());
  }
  return encoded;
}

/// "rtsp://USER@HOST/…", or {password}, with the password of the environment.
std::string with_password(const std::string& source) {
  constexpr std::string_view place = "{password}";
  const char* password = std::getenv("ALIDADE_PASSWORD");
  if (const std::size_t found = source.find(place); password != nullptr && found != std::string::npos)
    return source.substr(0, found) + percent_encoded(password) + source.substr(found + place.size());
  const std::size_t begin = source.find("://") + 3, at = source.find('@', begin);
  if (password == nullptr || at == std::string::npos || at > source.find('/', begin)) return source;
  return source.substr(0, at) + ":" + percent_encoded(password) + source.substr(at);
}

/// A server that shows no certificate of an authority gets no password: of this machine's authorities, or of those in
/// SSL_CERT_FILE, as OpenSSL and curl have it.
void believe_only_known(AVDictionary** options) {
  av_dict_set(options, "tls_verify", "1", 0);
  if (const char* authorities = std::getenv("SSL_CERT_FILE")) av_dict_set(options, "ca_file", authorities, 0);
}

class Input {
 public:
  ~Input() {
    av_packet_free(&packet_);
    av_frame_free(&frame_);
    avcodec_free_context(&codec_);
    avformat_close_input(&format_);
  }
  Input() = default;
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  bool open(const std::string& source) {
    const bool is_device = source.starts_with(device_prefix);
    AVDictionary* options = nullptr;
    const AVInputFormat* kind = nullptr;
    std::string url = source;
    if (is_device) {
      avdevice_register_all();
      kind = av_find_input_format("v4l2");
      if (kind == nullptr) return false;
      url = source.substr(device_prefix.size());
      av_dict_set(&options, "timestamps", "abs", 0);  // of the kernel, since 1970
    } else if (is_remote(source)) {
      avformat_network_init();
      url = with_password(source);
      av_dict_set(&options, "fflags", "nobuffer", 0);
      av_dict_set(&options, "timeout", "5000000", 0);  // of silence, µs
      believe_only_known(&options);
    } else {
      av_dict_set(&options, "protocol_whitelist", "file", 0);  // a play list leads nowhere else
      av_dict_set(&options, "pattern_type", "none", 0);        // '%' in a name is itself
    }
    const int opened = avformat_open_input(&format_, url.c_str(), kind, &options);
    av_dict_free(&options);
    takes_wall_clock_ = is_device;
    return opened == 0 && avformat_find_stream_info(format_, nullptr) >= 0 && open_codec();
  }

  /// False at the end.
  bool next(Times& times) {
    for (;;) {
      const int got = avcodec_receive_frame(codec_, frame_);
      if (got == 0) break;
      if (got != AVERROR(EAGAIN) || is_over_) return false;
      feed();
    }
    const AVStream& stream = *format_->streams[stream_];
    const std::int64_t stamp = frame_->best_effort_timestamp;
    times = {};
    if (stamp != AV_NOPTS_VALUE) times.media_s = static_cast<double>(stamp) * av_q2d(stream.time_base);
    if (takes_wall_clock_) times.taken_s = times.media_s;
    if (std::isfinite(taken_less_media_s_)) times.taken_s = times.media_s + taken_less_media_s_;
    return true;
  }

  [[nodiscard]] const AVFrame& frame() const { return *frame_; }
  /// As the file says; 0: it does not.
  [[nodiscard]] double num_frames() const {
    const AVStream& stream = *format_->streams[stream_];
    if (stream.nb_frames > 0) return static_cast<double>(stream.nb_frames);
    if (format_->duration == AV_NOPTS_VALUE) return 0.0;
    return std::floor(static_cast<double>(format_->duration) / AV_TIME_BASE * av_q2d(stream.avg_frame_rate) + 0.5);
  }
  /// Quarter turns to the right that make the frame upright.
  [[nodiscard]] int quarter_turns() const {
    const AVStream& stream = *format_->streams[stream_];
    const std::uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
    if (matrix == nullptr) return 0;
    const double turned = -av_display_rotation_get(reinterpret_cast<const std::int32_t*>(matrix)) / 90.0;
    return std::isfinite(turned) ? (static_cast<int>(std::lround(turned)) % 4 + 4) % 4 : 0;
  }

 private:
  bool open_codec() {
    const AVCodec* decoder = nullptr;
    stream_ = av_find_best_stream(format_, AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (stream_ < 0 || decoder == nullptr) return false;
    codec_ = avcodec_alloc_context3(decoder);
    packet_ = av_packet_alloc();
    frame_ = av_frame_alloc();
    if (codec_ == nullptr || packet_ == nullptr || frame_ == nullptr) return false;
    codec_->thread_count = 0;  // as many as there are processors
    if (avcodec_parameters_to_context(codec_, format_->streams[stream_]->codecpar) < 0) return false;
    codec_->pkt_timebase = format_->streams[stream_]->time_base;
    return avcodec_open2(codec_, decoder, nullptr) == 0;
  }

  /// A packet more; what is broken is passed over.
  void feed() {
    for (;;) {
      const int got = av_read_frame(format_, packet_);
      if (got == AVERROR(EAGAIN)) continue;
      if (got < 0) {
        is_over_ = true;
        avcodec_send_packet(codec_, nullptr);
        return;
      }
      const bool is_ours = packet_->stream_index == stream_;
      if (is_ours) {
        note_sender_time();
        avcodec_send_packet(codec_, packet_);
      }
      av_packet_unref(packet_);
      if (is_ours) return;
    }
  }

  /// RTCP's sender reports say what time it was at the sender: the packet's own is since 1970, in µs.
  void note_sender_time() {
    std::size_t size = 0;
    const std::uint8_t* data = av_packet_get_side_data(packet_, AV_PKT_DATA_PRFT, &size);
    if (data == nullptr || size < sizeof(AVProducerReferenceTime) || packet_->pts == AV_NOPTS_VALUE) return;
    AVProducerReferenceTime reference;
    std::memcpy(&reference, data, sizeof reference);
    const double media_s = static_cast<double>(packet_->pts) * av_q2d(format_->streams[stream_]->time_base);
    if (reference.wallclock > 0) taken_less_media_s_ = 1e-6 * static_cast<double>(reference.wallclock) - media_s;
  }

  AVFormatContext* format_ = nullptr;
  AVCodecContext* codec_ = nullptr;
  AVPacket* packet_ = nullptr;
  AVFrame* frame_ = nullptr;
  int stream_ = -1;
  bool is_over_ = false, takes_wall_clock_ = false;
  double taken_less_media_s_ = unknown;
};

/// Frames as 8-bit grey or BGR, upright.
class Image {
 public:
  explicit Image(bool is_bgr) : is_bgr_(is_bgr) {}
  ~Image() { sws_freeContext(scaler_); }
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  /// False: it cannot be converted, or has another size than the first.
  bool take(const AVFrame& frame, int quarter_turns) {
    const auto format = static_cast<AVPixelFormat>(frame.format);
    scaler_ = sws_getCachedContext(scaler_, frame.width, frame.height, format, frame.width, frame.height,
                                   AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr, nullptr, nullptr);
    if (scaler_ == nullptr || frame.width < 1 || frame.height < 1) return false;
    const int row_bytes = 3 * frame.width;
    const std::size_t padding = 64;  // its vector code writes beyond the end of a row
    bgr_.resize(static_cast<std::size_t>(row_bytes) * static_cast<std::size_t>(frame.height) + padding);
    std::array<std::uint8_t*, 4> planes{bgr_.data()};
    const std::array<int, 4> strides{row_bytes};
    if (sws_scale(scaler_, frame.data, frame.linesize, 0, frame.height, planes.data(), strides.data()) != frame.height)
      return false;
    const bool is_across = quarter_turns % 2 == 1;
    const int width = is_across ? frame.height : frame.width, height = is_across ? frame.width : frame.height;
    if (width_ != 0 && (width != width_ || height != height_)) return false;
    width_ = width;
    height_ = height;
    fill(frame.width, frame.height, quarter_turns);
    return true;
  }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  void fill(int width, int height, int turns) {
    const std::size_t channels = is_bgr_ ? 3 : 1;
    bytes_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * channels);
    std::uint8_t* to = bytes_.data();
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x, to += channels) {
        int u = x, v = y;  // in the frame as it was
        if (turns == 1) u = y, v = height - 1 - x;
        if (turns == 2) u = width - 1 - x, v = height - 1 - y;
        if (turns == 3) u = width - 1 - y, v = x;
        const std::uint8_t* from = bgr_.data() + 3 * (static_cast<std::size_t>(v) * static_cast<std::size_t>(width) +
                                                      static_cast<std::size_t>(u));
        if (is_bgr_) {
          std::memcpy(to, from, 3);
        } else {  // ITU-R BT.601: 0.114, 0.587 and 0.299 of 2^15
          *to = static_cast<std::uint8_t>((3735 * from[0] + 19235 * from[1] + 9798 * from[2] + (1 << 14)) >> 15);
        }
      }
    }
  }

  bool is_bgr_;
  SwsContext* scaler_ = nullptr;
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> bgr_, bytes_;
};

bool write_header(const Image& image, double frames) {
  std::array<char, 64> header{};
  const unsigned long count = frames > 0.0 && frames < 1e9 ? static_cast<unsigned long>(frames) : 0UL;
  std::snprintf(header.data(), header.size(), "alidade_video %d %d %lu", image.width(), image.height(), count);
  return std::fwrite(header.data(), 1, header.size(), stdout) == header.size();
}

bool write_frame(const Image& image, const Times& times) {
  const std::array<double, 2> numbers{times.media_s, times.taken_s};
  const bool is_written = std::fputc('f', stdout) == 'f' &&
                          std::fwrite(numbers.data(), sizeof(double), numbers.size(), stdout) == numbers.size() &&
                          std::fwrite(image.bytes().data(), 1, image.bytes().size(), stdout) == image.bytes().size();
  return is_written && std::fflush(stdout) == 0;
}

int decode(const std::string& source, bool is_bgr) {
  av_log_set_level(AV_LOG_QUIET);
  Input input;
  Image image(is_bgr);
  Times times;
  if (!input.open(source) || !input.next(times)) return 3;
  const int turns = input.quarter_turns();
  if (!image.take(input.frame(), turns) || !write_header(image, input.num_frames())) return 3;
  do {
    if (!image.take(input.frame(), turns) || !write_frame(image, times)) return 3;
  } while (input.next(times));
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
