#include "alidade/files/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <system_error>

#include "alidade/files/descriptor.h"
#include "alidade/files/sync.h"

namespace alidade {
namespace {

constexpr std::size_t max_bytes = std::size_t{1} << 30U;  // 1 GiB: far beyond any table or photo, below any memory

/// Removes the temporary file again unless it was renamed.
struct Temporary {
  std::filesystem::path path;
  bool kept = false;

  explicit Temporary(std::filesystem::path where) : path(std::move(where)) {}
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    if (!kept) ::unlink(path.c_str());
  }
};

/// A name beside `file` that no other run, and no other thread of this one, uses.
std::filesystem::path temporary_name(const std::filesystem::path& file) {
  static std::atomic<unsigned> count{0};
  std::string name = ".";
  name.append(file.filename().string()).append(".").append(std::to_string(::getpid()));
  name.append("-").append(std::to_string(count++)).append(".part");
  return file.parent_path() / name;
}

/// Content under a name that is not yet `file`. A file without a name comes first, so that a killed run leaves nothing
/// at all; where the file system knows no such files, a file that stands under the temporary name from the start.
void write_temporary(const std::filesystem::path& file, const std::filesystem::path& name, std::string_view content) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const Descriptor unnamed(::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666));
  if (unnamed.is_open()) {
    write_all(file, unnamed, content);
    sync_file(file, unnamed);
    const std::string link = "/proc/self/fd/" + std::to_string(unnamed.number());
    if (::linkat(AT_FDCWD, link.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0) return;
  }
  const Descriptor named(::open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666));
  if (!named.is_open()) fail_on(file, "cannot be written", errno);
  write_all(file, named, content);
  sync_file(file, named);
}

void write_through(const std::filesystem::path& file, std::string_view content) {
  const Descriptor out(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
  if (!out.is_open()) fail_on(file, "cannot be written", errno);
  write_all(file, out, content);
}

void replace_file(const std::filesystem::path& file, std::string_view content) {
  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  if (error) fail_on(file, "cannot be written", error.value());
  Temporary temporary(temporary_name(file));
  write_temporary(file, temporary.path, content);
  if (::rename(temporary.path.c_str(), file.c_str()) != 0) fail_on(file, "cannot be written", errno);
  temporary.kept = true;
  sync_all({file.has_parent_path() ? file.parent_path() : "."});
}

}  // namespace

[[noreturn]] void fail_on(const std::filesystem::path& file, const char* what, int error) {
  throw InputError(file.string() + ": " + what + ": " + std::generic_category().message(error));
}

void write_all(const std::filesystem::path& file, const Descriptor& out, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(out.number(), content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail_on(file, "cannot be written", errno);
    content.remove_prefix(static_cast<std::size_t>(written));
  }
}

std::string read_file(const std::filesystem::path& file) {
  const Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!in.is_open()) fail_on(file, "cannot be read", errno);
  struct stat status {};
  if (::fstat(in.number(), &status) != 0) fail_on(file, "cannot be read", errno);
  if (S_ISDIR(status.st_mode)) throw InputError(file.string() + ": is a folder, not a file");
  std::string content;
  content.reserve(std::min(static_cast<std::size_t>(std::max<off_t>(status.st_size, 0)), max_bytes));
  std::array<char, 65536> chunk{};
  while (true) {  // to the end, not to the size: pipes have none
    const ssize_t got = ::read(in.number(), chunk.data(), chunk.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_on(file, "cannot be read", errno);
    if (got == 0) return content;
    content.append(chunk.data(), static_cast<std::size_t>(got));
    if (content.size() > max_bytes) throw InputError(file.string() + ": is larger than 1 GiB");
  }
}

bool takes_bytes(const std::filesystem::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}

std::filesystem::path place_of(const std::filesystem::path& file) {
  constexpr int max_links = 40;  // as Linux follows
  std::filesystem::path place = file;
  std::error_code error;
  for (int i = 0; i < max_links && std::filesystem::is_symlink(place, error); ++i)
    place = place.parent_path() / std::filesystem::read_symlink(place, error);  // an absolute one stands for itself
  return place;
}

void write_file(const std::filesystem::path& file, std::string_view content) {
  std::error_code error;
  if (file.filename().empty() || std::filesystem::is_directory(file, error)) {
    throw InputError(file.string() + ": is a folder, not a file");
  }
  if (takes_bytes(file))
    write_through(file, content);
  else
    replace_file(place_of(file), content);
}

}  // namespace alidade
