#include "alidade/images/video_process.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/files.h"

namespace alidade {
namespace {

constexpr const char* decoder_name = "alidade_video";

/// Of the executable; and of the library or the Python module that this code is in: up to five folders above its file,
/// and `bin` in each.
std::vector<std::filesystem::path> decoder_folders() {
  std::error_code error;
  std::vector<std::filesystem::path> folders = {std::filesystem::read_symlink("/proc/self/exe", error).parent_path()};
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&decoder_folders), &info) == 0 || info.dli_fname == nullptr)
    return folders;
  std::filesystem::path folder = std::filesystem::absolute(info.dli_fname, error);
  for (int i = 0; i < 5 && folder.has_relative_path(); ++i) {
    folder = folder.parent_path();
    folders.push_back(folder);
    folders.push_back(folder / "bin");
  }
  return folders;
}

std::filesystem::path decoder_beside_this_program(const std::filesystem::path& video) {
  std::error_code error;
  for (const std::filesystem::path& folder : decoder_folders()) {
    if (std::filesystem::is_regular_file(folder / decoder_name, error)) return folder / decoder_name;
  }
  throw InputError(video.string() + ": video files are decoded by the program '" + decoder_name +
                   "', which is not beside this one; give a folder of numbered images");
}

/// Decoders draw text files as moving letters, and play lists lead elsewhere.
void refuse_text(const std::filesystem::path& video) {
  std::array<char, 4096> bytes{};
  std::ifstream in(video, std::ios::binary);
  if (!in) throw InputError(video.string() + ": cannot be read");
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const auto* const end = bytes.data() + in.gcount();
  if (end == bytes.data()) throw InputError(video.string() + ": the file is empty");
  const bool is_raw_video = std::string_view(bytes.data(), 9) == "YUV4MPEG2";  // its header is text
  const bool is_text = !is_raw_video && std::none_of(static_cast<const char*>(bytes.data()), end, [](char c) {
    return static_cast<unsigned char>(c) < 0x20U && c != '\n' && c != '\r' && c != '\t' && c != '\f';
  });
  if (is_text) throw InputError(video.string() + ": is a text file, not a video");
}

/// Its output goes to `pipe_end`; what it has to say otherwise, nowhere.
int start_decoder(const std::string& decoder, const std::string& video, FrameColour colour, int pipe_end,
                  const std::string& password) {
  constexpr std::string_view variable = "ALIDADE_PASSWORD=";
  std::string secret = std::string(variable) + password;
  std::vector<char*> environment;
  for (char** each = environ; *each != nullptr; ++each)
    if (!std::string_view(*each).starts_with(variable)) environment.push_back(*each);
  if (!password.empty()) environment.push_back(secret.data());
  environment.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, pipe_end, STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::array<std::string, 3> words{decoder, video, colour == FrameColour::bgr ? "bgr" : "grey"};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t process = -1;
  const int error = posix_spawn(&process, decoder.c_str(), &actions, nullptr, arguments.data(), environment.data());
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? process : -1;
}

/// A camera of the machine that is not plugged in.
void require_device(const std::string& address) {
  constexpr std::string_view scheme = "v4l2:";
  std::error_code ignored;
  if (!address.starts_with(scheme) || std::filesystem::exists(address.substr(scheme.size()), ignored)) return;
  throw InputError(address + ": there is no such device; is the camera plugged in?");
}

}  // namespace

bool is_stream_address(const std::string& text) {
  return text.starts_with("v4l2:") || text.starts_with("rtsp://") || text.starts_with("http://") ||
         text.starts_with("https://");
}

// Absolute: a name like "http:…" shall not be an address.
VideoProcess::VideoProcess(const std::filesystem::path& video, FrameColour colour) : video_(video), colour_(colour) {
  refuse_text(video);
  start(std::filesystem::absolute(video).string(), "");
}

VideoProcess::VideoProcess(const StreamAddress& stream, FrameColour colour)
    : video_(stream.text), colour_(colour), is_stream_(true) {
  require_device(stream.text);
  start(stream.text, stream.password);
}

void VideoProcess::start(const std::string& source, const std::string& password) {
  const std::filesystem::path decoder = decoder_beside_this_program(video_);
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw InputError(video_.string() + ": no pipe to the decoder");
  process_ = start_decoder(decoder.string(), source, colour_, ends[1], password);
  ::close(ends[1]);
  pipe_ = ends[0];
  try {
    read_header();
  } catch (const InputError&) {
    stop();
    throw;
  }
}

VideoProcess::~VideoProcess() { stop(); }

void VideoProcess::interrupt() const {
  if (process_ > 0) ::kill(process_, SIGKILL);
}

void VideoProcess::stop() {
  if (pipe_ >= 0) ::close(pipe_);
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  pipe_ = process_ = -1;
}

/// "alidade_video WIDTH HEIGHT FRAMES" in 64 characters.
void VideoProcess::read_header() {
  constexpr int largest_px = 1 << 15;
  std::array<char, 65> header{};
  unsigned long frames = 0;
  const bool is_good = process_ > 0 && read_bytes(header.data(), 64) &&
                       std::sscanf(header.data(), "alidade_video %d %d %lu", &width_px_, &height_px_, &frames) == 3 &&
                       width_px_ > 0 && height_px_ > 0 && width_px_ < largest_px && height_px_ < largest_px;
  if (is_good) {
    num_frames_ = frames;
    return;
  }
  if (is_stream_)
    throw InputError(video_.string() + ": no images arrive: nothing answers, or what answers is no video, or " +
                     (video_.string().starts_with("https:")
                          ? "its certificate is not one that this machine trusts (SSL_CERT_FILE=FILE: authorities)"
                          : "another program has the camera"));
  throw InputError(video_.string() + ": not a video that can be read");
}

std::vector<unsigned char> VideoProcess::next() {
  char mark = 0;
  if (!read_bytes(&mark, 1)) throw InputError(video_.string() + ": the decoder stopped within a frame");
  if (mark != 'f') return {};
  std::array<double, 2> times{};
  if (!read_bytes(times.data(), sizeof times))
    throw InputError(video_.string() + ": the decoder stopped within a frame");
  time_ = {times[0], times[1]};
  const std::size_t channels = colour_ == FrameColour::bgr ? 3 : 1;
  std::vector<unsigned char> frame(static_cast<std::size_t>(width_px_) * static_cast<std::size_t>(height_px_) *
                                   channels);
  if (!read_bytes(frame.data(), frame.size()))
    throw InputError(video_.string() + ": the decoder stopped within a frame");
  return frame;
}

bool VideoProcess::read_bytes(void* to, std::size_t count) const {
  auto* at = static_cast<char*>(to);
  while (count > 0) {
    const ssize_t got = ::read(pipe_, at, count);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

}  // namespace alidade
