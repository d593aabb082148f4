#include "alidade/files/spool.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "alidade/files/files.h"

namespace alidade {
namespace {

std::filesystem::path existing_folder(const std::filesystem::path& folder) {
  std::filesystem::path at = std::filesystem::absolute(folder).lexically_normal();
  std::error_code ignored;
  while (!std::filesystem::is_directory(at, ignored) && at != at.parent_path()) at = at.parent_path();
  return at;
}

}  // namespace

Spool::Spool(std::filesystem::path folder)
    : folder_(std::move(folder)),
      descriptor_(::open(existing_folder(folder_).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600)) {
  if (descriptor_ >= 0) return;
  // Not every file system knows files without a name: one that loses its name at once.
  std::string name = existing_folder(folder_) / ".alidade-XXXXXX";
  descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor_ < 0) fail("cannot be written");
  ::unlink(name.c_str());
}

Spool::~Spool() { ::close(descriptor_); }

void Spool::fail(const char* what) const {
  throw InputError(folder_.string() + ": " + what + ": " + std::generic_category().message(errno));
}

Spool::Place Spool::put(std::string_view bytes) {
  const Place place{end_, bytes.size()};
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(end_));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("cannot be written");
    bytes.remove_prefix(static_cast<std::size_t>(written));
    end_ += static_cast<std::uint64_t>(written);
  }
  return place;
}

std::string Spool::get(Place place) const {
  std::string bytes(place.size, '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got =
        ::pread(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(place.at + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) fail("what was put aside there cannot be read");
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace alidade
