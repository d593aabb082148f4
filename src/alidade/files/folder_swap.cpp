#include "alidade/files/folder_swap.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include "alidade/files/files.h"
#include "alidade/files/sync.h"

namespace alidade {
namespace {

namespace fs = std::filesystem;

constexpr const char* hidden_prefix = ".alidade-";
// Inside the hidden folder. The third name says that all that was older is out of the way.
constexpr const char *new_files = "new", *older_files = "older", *replaced_files = "replaced";
constexpr const char* last_name = "last";  // its content: the file that comes last

/// The folder open and locked; not open where another process has it, or the file system knows no locks.
Descriptor locked(const fs::path& folder) {
  Descriptor descriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!descriptor.is_open() || ::flock(descriptor.number(), LOCK_EX | LOCK_NB) == 0) return descriptor;
  const int error = errno;
  (void)descriptor.close();
  errno = error;
  return descriptor;
}

bool stands_at(const fs::path& path) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0;
}

/// Every file under `from` to the same place under `to`, `last` after all others.
void move_files(const fs::path& from, const fs::path& to, const fs::path& last) {
  std::error_code ignored;
  std::vector<fs::path> names;
  for (const auto& entry : fs::recursive_directory_iterator(from, ignored)) {
    if (!entry.is_directory(ignored) || entry.is_symlink(ignored))
      names.push_back(entry.path().lexically_relative(from));
  }
  std::partition(names.begin(), names.end(), [&](const fs::path& name) { return name != last; });
  for (const fs::path& name : names) {
    fs::create_directories((to / name).parent_path(), ignored);
    fs::rename(from / name, to / name, ignored);
  }
}

/// A hidden folder as FolderSwap makes it: with nothing else in it.
bool is_of_swap(const fs::path& hidden) {
  std::error_code ignored;
  const auto is_own = [](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename();
    return name == new_files || name == older_files || name == replaced_files || name == last_name;
  };
  return std::all_of(fs::directory_iterator(hidden, ignored), fs::directory_iterator(), is_own);
}

/// What processes that were killed left in the folder. One killed within commit(): before the older files were all out
/// of the way it is undone, after that it is ended.
void clear_remains(const fs::path& folder) {
  std::error_code ignored;
  std::vector<fs::path> remains;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().filename().string().starts_with(hidden_prefix)) remains.push_back(entry.path());
  }
  for (const fs::path& hidden : remains) {
    const Descriptor lock = locked(hidden);
    if (!lock.is_open() || !is_of_swap(hidden)) continue;
    const fs::path last = stands_at(hidden / last_name) ? read_file(hidden / last_name) : "";
    if (stands_at(hidden / older_files)) move_files(hidden / older_files, folder, last);
    if (stands_at(hidden / replaced_files)) move_files(hidden / new_files, folder, last);
    fs::remove_all(hidden, ignored);
  }
}

/// The content that will be at `place`. Throws InputError, and leaves nothing of it, if it cannot be written.
void write_waiting(const fs::path& place, const fs::path& waiting, std::string_view content) {
  Descriptor file(::open(waiting.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0666));
  if (!file.is_open()) fail_on(place, "cannot be written", errno);
  try {
    write_all(place, file, content);
    if (!file.close()) fail_on(place, "cannot be written", errno);
  } catch (const InputError&) {
    ::unlink(waiting.c_str());
    throw;
  }
}

std::vector<fs::path> unique(std::vector<fs::path> paths) {
  std::sort(paths.begin(), paths.end());
  paths.erase(std::unique(paths.begin(), paths.end()), paths.end());
  return paths;
}

}  // namespace

MadeFolders::~MadeFolders() { remove_empty(); }

void MadeFolders::remove_empty() noexcept {
  for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder) ::rmdir(folder->c_str());
}

void MadeFolders::make(const fs::path& folder) {
  // Another process that only tries a folder beside it may take what both are in away again.
  constexpr int tries = 100;
  for (int i = 0; !make_once(folder); ++i) {
    if (errno != ENOENT || i + 1 == tries) fail_on(folder, "cannot be made", errno);
  }
}

std::vector<fs::path> MadeFolders::parents() const {
  std::vector<fs::path> parents;
  for (const fs::path& made : made_) parents.push_back(made.has_parent_path() ? made.parent_path() : ".");
  return parents;
}

bool MadeFolders::make_once(const fs::path& folder) {
  std::vector<fs::path> missing;
  std::error_code ignored;
  for (fs::path at = folder; !at.empty() && !fs::exists(at, ignored); at = at.parent_path()) {
    missing.push_back(at);
    if (at == at.parent_path()) break;
  }
  for (auto at = missing.rbegin(); at != missing.rend(); ++at) {
    if (::mkdir(at->c_str(), 0777) == 0) {
      made_.push_back(*at);
    } else if (errno != EEXIST) {
      return false;
    }
  }
  return true;
}

FolderSwap::FolderSwap(fs::path folder) : folder_(std::move(folder)) {
  if (folder_.empty()) folder_ = ".";
  std::error_code ignored;
  if (fs::exists(folder_, ignored) && !fs::is_directory(folder_, ignored)) {
    throw InputError(folder_.string() + ": is a file, not a folder");
  }
  // Another process that tries the folder may take it away again, or a hidden folder that is not locked yet.
  for (int i = 0; i < 20 && !hide(); ++i) {
  }
  if (!lock_) fail_on(folder_, "cannot be written", errno);
  clear_remains(folder_);
}

/// Makes the hidden folder. False where it did not work; with `errno` ENOENT or EAGAIN it may the next time.
bool FolderSwap::hide() {
  made_.make(folder_);
  std::string pattern = folder_ / (std::string(hidden_prefix) + "XXXXXX");
  if (::mkdtemp(pattern.data()) == nullptr) {
    if (errno != ENOENT) fail_on(folder_, "cannot be written", errno);
    return false;
  }
  // From here on it is removed with this object; not by another attempt, where it belongs to another process by then.
  hidden_folder_.path = std::move(pattern);
  Descriptor lock = locked(hidden_folder_.path);
  if (!lock.is_open() && errno == EWOULDBLOCK) {
    hidden_folder_.path.clear();
    return false;
  }
  if (::mkdir((hidden_folder_.path + "/" + new_files).c_str(), 0777) != 0) {
    const int error = errno;
    ::rmdir(hidden_folder_.path.c_str());
    hidden_folder_.path.clear();
    if (error != ENOENT) fail_on(folder_, "cannot be written", error);
    errno = error;
    return false;
  }
  hidden_ = hidden_folder_.path;
  lock_.emplace(std::move(lock));
  return true;
}

FolderSwap::HiddenFolder::~HiddenFolder() {
  if (path.empty()) return;
  std::error_code ignored;
  try {
    fs::remove_all(path, ignored);
  } catch (const std::bad_alloc&) {  // the next FolderSwap there clears it
  }
}

void FolderSwap::add(const fs::path& name, std::string_view content) {
  const fs::path place = folder_ / name, waiting = hidden_ / new_files / name;
  std::error_code error;
  if (fs::is_directory(place, error)) throw InputError(place.string() + ": is a folder, not a file");
  fs::create_directories(waiting.parent_path(), error);
  if (error) fail_on(place, "cannot be written", error.value());
  write_waiting(place, waiting, content);
  if (std::find(added_.begin(), added_.end(), name) == added_.end()) added_.push_back(name);
}

void FolderSwap::remove(const fs::path& name) { removed_.push_back(name); }

void FolderSwap::move(const fs::path& from, const fs::path& to) {
  moves_.push_back({from, to});  // first: what is moved must be known, or it cannot be undone
  if (::rename(from.c_str(), to.c_str()) == 0) return;
  const int error = errno;
  moves_.pop_back();
  throw fs::filesystem_error("rename", from, to, {error, std::generic_category()});
}

void FolderSwap::undo() noexcept {
  for (auto done = moves_.rbegin(); done != moves_.rend(); ++done) {
    if (::rename(done->to.c_str(), done->from.c_str()) == 0) continue;
    made_.remove_empty();  // a folder that was made where the older result has a file
    // What cannot go back stays in the hidden folder, for the next FolderSwap to move.
    if (::rename(done->to.c_str(), done->from.c_str()) != 0) hidden_folder_.path.clear();
  }
  moves_.clear();
}

/// What is new, with the folders that list it: after it every rename finds whole files, whatever happens to the power.
void FolderSwap::sync_new() const {
  std::vector<fs::path> files, folders = {hidden_ / new_files, hidden_};
  if (!added_.empty()) files.push_back(hidden_ / last_name);
  for (const fs::path& name : added_) {
    files.push_back(hidden_ / new_files / name);
    for (fs::path in = name.parent_path(); !in.empty(); in = in.parent_path())
      folders.push_back(hidden_ / new_files / in);
  }
  sync_all(files);
  sync_all(unique(std::move(folders)));
}

/// The folders whose lists of names commit() changed.
void FolderSwap::sync_places() const {
  std::vector<fs::path> folders = made_.parents();
  folders.push_back(folder_);
  for (const fs::path& name : added_) folders.push_back((folder_ / name).parent_path());
  sync_all(unique(std::move(folders)));
}

/// A file of an earlier result goes into the hidden folder.
void FolderSwap::set_aside(const fs::path& name) {
  const fs::path at = folder_ / name;
  std::error_code ignored;
  if (!stands_at(at) || fs::is_directory(fs::symlink_status(at, ignored))) return;
  fs::create_directories((hidden_ / older_files / name).parent_path());
  move(at, hidden_ / older_files / name);
}

void FolderSwap::commit() {
  if (!added_.empty()) write_waiting(folder_, hidden_ / last_name, added_.front().string());
  sync_new();
  std::vector<fs::path> going = added_;
  going.insert(going.end(), removed_.begin(), removed_.end());
  const Descriptor turn(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (turn.is_open()) ::flock(turn.number(), LOCK_EX);  // one after the other; where there are no locks, at once
  fs::path at;
  try {
    fs::create_directory(hidden_ / older_files);
    for (const fs::path& name : going) {
      at = folder_ / name;
      set_aside(name);
    }
    move(hidden_ / older_files, hidden_ / replaced_files);
    for (auto name = added_.rbegin(); name != added_.rend(); ++name) {
      at = folder_ / *name;
      made_.make(at.parent_path());
      move(hidden_ / new_files / *name, at);
    }
    sync_places();
  } catch (const fs::filesystem_error& error) {
    undo();
    fail_on(at.empty() ? folder_ : at, "cannot be written", error.code().value());
  } catch (...) {
    undo();
    throw;
  }
  try {
    for (const fs::path& name : going) {  // folders that earlier files stood in
      for (fs::path in = name.parent_path(); !in.empty() && ::rmdir((folder_ / in).c_str()) == 0;)
        in = in.parent_path();
    }
  } catch (const std::bad_alloc&) {  // all is in its place; an empty folder stays
  }
  added_.clear();
  removed_.clear();
  moves_.clear();
}

}  // namespace alidade
