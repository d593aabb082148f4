#include "alidade/files/sync.h"

#include <fcntl.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <system_error>
#include <thread>

namespace alidade {
namespace {

/// 0, or the errno.
int sync_error(const Descriptor& open) {
  if (::fsync(open.number()) == 0 || errno == EINVAL || errno == ENOTSUP) return 0;
  return errno;
}

int sync_error(const std::filesystem::path& path) {
  const Descriptor open(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  return open.is_open() ? sync_error(open) : errno;
}

/// Takes one path after the other, as other threads do in parallel. Allocates nothing: it could not report a failure.
class Syncing {
 public:
  explicit Syncing(const std::vector<std::filesystem::path>& paths) : paths_(paths) {}
  void work() noexcept {
    for (std::size_t i = next_++; i < paths_.size(); i = next_++) {
      const int error = sync_error(paths_[i]);
      if (error == 0) continue;
      failed_ = i;
      error_ = error;
    }
  }
  void throw_if_failed() const {
    if (error_ != 0) fail_on(paths_[failed_], "cannot be written", error_);
  }

 private:
  const std::vector<std::filesystem::path>& paths_;
  std::atomic<std::size_t> next_{0}, failed_{0};
  std::atomic<int> error_{0};
};

}  // namespace

void sync_file(const std::filesystem::path& file, const Descriptor& open) {
  const int error = sync_error(open);
  if (error != 0) fail_on(file, "cannot be written", error);
}

void sync_all(const std::vector<std::filesystem::path>& paths) {
  constexpr std::size_t max_at_once = 8;  // they wait for the disk, not for a core
  Syncing syncing(paths);
  {
    std::vector<std::jthread> others;
    others.reserve(max_at_once);
    try {
      for (std::size_t i = 1; i < std::min(max_at_once, paths.size()); ++i)
        others.emplace_back([&syncing] { syncing.work(); });
    } catch (const std::exception&) {  // no more threads: those that are there do it
    }
    syncing.work();
  }
  syncing.throw_if_failed();
}

}  // namespace alidade
