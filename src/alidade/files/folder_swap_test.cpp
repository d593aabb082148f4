#include "alidade/files/folder_swap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <array>
#include <csignal>
#include <map>
#include <thread>

#include "alidade/files/descriptor.h"
#include "alidade/testing/fault.h"
#include "alidade/testing/process.h"

namespace alidade {
namespace {

namespace fs = std::filesystem;
using testing::fault_of;
using ::testing::HasSubstr;
using testing::run_in_child;
using testing::TemporaryFolder;

/// Every file of a folder, hidden ones too, with its content.
std::map<std::string, std::string> content_of(const fs::path& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder);
    content[name] = entry.is_directory() ? "a folder" : read_file(entry.path());
  }
  return content;
}

using Content = std::map<std::string, std::string>;

TEST(FolderSwap, NothingStandsThereBeforeCommit) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a", "old");
  {
    FolderSwap swap(folder.path());
    swap.add("a", "new");
    swap.add("deep/b", "new");
    swap.remove("c");
    EXPECT_EQ(read_file(folder.path() / "a"), "old");
    EXPECT_FALSE(fs::exists(folder.path() / "deep"));
  }
  EXPECT_EQ(content_of(folder.path()), (Content{{"a", "old"}})) << "without commit() nothing is left";
}

TEST(FolderSwap, CommitReplacesAddsAndRemoves) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a", "old");
  write_file(folder.path() / "gone", "old");
  write_file(folder.path() / "frames/1", "old");
  write_file(folder.path() / "mine", "mine");
  FolderSwap swap(folder.path());
  swap.add("a", "new");
  swap.add("deep/er/b", "new");
  for (const char* name : {"gone", "frames/1", "never", "a"}) swap.remove(name);
  swap.commit();
  EXPECT_EQ(read_file(folder.path() / "a"), "new");
  EXPECT_EQ(read_file(folder.path() / "deep/er/b"), "new");
  EXPECT_EQ(read_file(folder.path() / "mine"), "mine");
  EXPECT_FALSE(fs::exists(folder.path() / "gone"));
  EXPECT_FALSE(fs::exists(folder.path() / "frames"));
}

TEST(FolderSwap, AFolderThatWasNotThereIsNotThereAfterAll) {
  const TemporaryFolder folder;
  { const FolderSwap swap(folder.path() / "x" / "y"); }
  EXPECT_EQ(content_of(folder.path()), Content{});
  FolderSwap swap(folder.path() / "x" / "y");
  swap.add("a", "new");
  swap.commit();
  EXPECT_EQ(read_file(folder.path() / "x/y/a"), "new");
}

TEST(FolderSwap, APlaceThatCannotBeIsNamed) {
  const TemporaryFolder folder;
  write_file(folder.path() / "file", "x");
  EXPECT_THAT(fault_of([&] { const FolderSwap swap(folder.path() / "file"); }), HasSubstr("is a file, not a folder"));
  EXPECT_THAT(fault_of([&] { const FolderSwap swap(folder.path() / "file" / "x"); }),
              HasSubstr("file/x: cannot be made"));
  EXPECT_THAT(fault_of([&] { const FolderSwap swap(folder.path() / "a" / std::string(300, 'x')); }),
              HasSubstr("File name too long"));
  EXPECT_THAT(fault_of([] { const FolderSwap swap("/proc/alidade"); }), HasSubstr("/proc/alidade: cannot be made"));
  fs::create_directory(folder.path() / "taken");
  FolderSwap swap(folder.path());
  EXPECT_THAT(fault_of([&] { swap.add("taken", "x"); }), HasSubstr("taken: is a folder, not a file"));
  EXPECT_EQ(content_of(folder.path()).count("a"), 0u) << "of what was tried nothing is left";
}

TEST(FolderSwap, ACommitThatFailsHalfwayIsUndone) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a", "old");
  write_file(folder.path() / "b", "old");
  write_file(folder.path() / "gone", "old");
  const Content before = content_of(folder.path());
  {
    FolderSwap swap(folder.path());
    for (const char* name : {"a", "b", "in/c"}) swap.add(name, "new");
    swap.remove("gone");
    write_file(folder.path() / "in", "in the way: a file where a folder must be");
    EXPECT_THAT(fault_of([&] { swap.commit(); }), HasSubstr("cannot be"));
    fs::remove(folder.path() / "in");
  }
  EXPECT_EQ(content_of(folder.path()), before);
}

/// Two contents, one of which a folder has whenever anybody looks.
void expect_one_of_two(const Content& now, const Content& old, const Content& made, int* num_old) {
  EXPECT_TRUE(now == old || now == made);
  *num_old += now == old ? 1 : 0;
}

TEST(FolderSwap, KilledAtAnyMomentTheFolderIsTheOldOneOrTheNewOne) {
  int num_old = 0, num_runs = 0;
  double max_wait_us = 4000.0;  // grows while no run comes to its end, as a busy disk makes all of them slower
  for (; num_runs < 40; ++num_runs) {
    const auto wait_us = static_cast<int>(max_wait_us * (num_runs % 10) / 10.0);
    const int num_old_before = num_old;
    const TemporaryFolder folder;
    Content old, made;
    for (const char* name : {"result.json", "a", "b", "gone"}) old[name] = "old";
    for (const char* name : {"result.json", "a", "b", "c", "d"}) made[name] = std::string(100'000, 'n');
    for (const auto& [name, content] : old) write_file(folder.path() / name, content);
    (void)run_in_child(
        [&] {
          FolderSwap swap(folder.path());
          for (const auto& [name, content] : made) swap.add(name, content);
          swap.remove("gone");
          swap.commit();
          return 0;
        },
        [&](pid_t child) {
          std::this_thread::sleep_for(std::chrono::microseconds(wait_us));
          ::kill(child, SIGKILL);
        });
    { const FolderSwap next(folder.path()); }  // clears what was left
    expect_one_of_two(content_of(folder.path()), old, made, &num_old);
    max_wait_us *= num_old > num_old_before ? 1.1 : 0.9;
  }
  EXPECT_GT(num_old, 0);
  EXPECT_LT(num_old, num_runs) << "no run came to its end";
}

/// As the folder stands when a process is killed after so many renames of commit().
void cut_commit(const fs::path& folder, int num_renames) {
  const fs::path hidden = folder / ".alidade-killed";
  write_file(hidden / "new/a", "new");
  write_file(hidden / "new/c", "new");
  fs::create_directory(hidden / "older");
  const std::vector<std::pair<fs::path, fs::path>> renames{{folder / "a", hidden / "older/a"},
                                                           {folder / "gone", hidden / "older/gone"},
                                                           {hidden / "older", hidden / "replaced"},
                                                           {hidden / "new/c", folder / "c"},
                                                           {hidden / "new/a", folder / "a"}};
  for (int i = 0; i < num_renames; ++i) {
    fs::rename(renames[static_cast<std::size_t>(i)].first, renames[static_cast<std::size_t>(i)].second);
  }
}

TEST(FolderSwap, ACommitCutInTwoIsUndoneOrEndedByTheNextOne) {
  for (int num_renames = 0; num_renames <= 5; ++num_renames) {
    const TemporaryFolder folder;
    const Content old{{"a", "old"}, {"gone", "old"}, {"mine", "mine"}};
    const Content made{{"a", "new"}, {"c", "new"}, {"mine", "mine"}};
    for (const auto& [name, content] : old) write_file(folder.path() / name, content);
    cut_commit(folder.path(), num_renames);
    { const FolderSwap next(folder.path()); }
    EXPECT_EQ(content_of(folder.path()), num_renames < 3 ? old : made) << num_renames;
  }
}

/// Names in the order in which they are moved into a folder while `work` runs.
std::vector<std::string> moved_into(const fs::path& folder, const std::function<void()>& work) {
  const Descriptor watch(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC));
  EXPECT_GE(::inotify_add_watch(watch.number(), folder.c_str(), IN_MOVED_TO), 0);
  work();
  std::vector<std::string> names;
  alignas(inotify_event) std::array<char, 65536> buffer{};
  const ssize_t size = ::read(watch.number(), buffer.data(), buffer.size());
  for (ssize_t at = 0; at < size;) {
    const auto* event = reinterpret_cast<const inotify_event*>(buffer.data() + at);
    names.emplace_back(event->name);
    at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
  }
  return names;
}

/// A commit() of twenty files and result.json that was killed: before any new file came, or before any older one went
/// back.
void cut_commit_of_many(const fs::path& folder, const std::string& moved) {
  const fs::path hidden = folder / ".alidade-killed";
  write_file(hidden / "last", "result.json");
  for (const std::string in : {"new", moved.c_str()}) {
    write_file(hidden / in / "result.json", in);
    for (int i = 0; i < 20; ++i) write_file(hidden / in / std::to_string(i), in);
  }
}

TEST(FolderSwap, TheNextOneMovesTheFileThatDescribesTheOthersLastToo) {
  for (const char* moved :
       {"older", "replaced"}) {  // a second kill must find no result.json beside files that are not its own
    const TemporaryFolder folder;
    cut_commit_of_many(folder.path(), moved);
    const std::vector<std::string> names = moved_into(folder.path(), [&] { const FolderSwap next(folder.path()); });
    ASSERT_EQ(names.size(), 21u);
    EXPECT_EQ(names.back(), "result.json") << moved;
  }
}

TEST(FolderSwap, CommitSaysInTheHiddenFolderWhichFileComesLast) {
  const TemporaryFolder folder;
  FolderSwap swap(folder.path());
  swap.add("result.json", "new");
  swap.add("a", "new");
  swap.commit();
  std::string last;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    if (entry.is_directory()) last = read_file(entry.path() / "last");
  }
  EXPECT_EQ(last, "result.json");
}

TEST(FolderSwap, AFileWhoseFolderToBeFailsIsNotLost) {
  const TemporaryFolder folder;
  write_file(folder.path() / "result.json", "old");
  write_file(folder.path() / "a", "old: a file, and in the new result a folder");
  const Content before = content_of(folder.path());
  {
    FolderSwap swap(folder.path());
    for (const char* name : {"result.json", "in", "a/b/c"}) swap.add(name, "new");
    swap.remove("a");
    fs::create_directory(folder.path() / "in");  // in the way, and found after a/b/c has its place
    EXPECT_NE(fault_of([&] { swap.commit(); }), "");
    fs::remove(folder.path() / "in");
  }
  EXPECT_EQ(content_of(folder.path()), before);
}

TEST(FolderSwap, WhatAnotherProcessIsWritingIsNotCleared) {
  const TemporaryFolder folder;
  FolderSwap swap(folder.path());
  swap.add("a", "new");
  { const FolderSwap other(folder.path()); }
  swap.commit();
  EXPECT_EQ(read_file(folder.path() / "a"), "new");
}

TEST(FolderSwap, ManyProcessesAtOnceLeaveTheFilesOfOneOfThem) {
  const TemporaryFolder folder;
  const fs::path place = folder.path() / "in" / "out";
  const auto outcome = run_in_child([&] {
    std::vector<pid_t> children;
    for (char letter = 'a'; letter < 'i'; ++letter) {
      children.push_back(::fork());
      if (children.back() != 0) continue;
      std::string fault;
      for (int i = 0; i < 25 && fault.empty(); ++i) {
        fault = fault_of([&] {
          { const FolderSwap tried(place); }
          FolderSwap swap(place);
          for (const char* name : {"1", "2", "3", "4"}) swap.add(name, std::string(20'000, letter));
          swap.commit();
        });
      }
      if (!fault.empty()) std::printf("%s\n", fault.c_str());
      std::fflush(stdout);
      ::_exit(0);
    }
    for (const pid_t child : children) ::waitpid(child, nullptr, 0);
    return 0;
  });
  EXPECT_EQ(outcome.out, "");
  const Content now = content_of(place);
  EXPECT_EQ(now.size(), 4u);
  for (const auto& [name, content] : now) EXPECT_EQ(content, now.begin()->second) << name;
}

/// Folders beside one another in one that is not there: who only tries takes it away again while others make it. None
/// fails, and no file stays; who made a folder cannot take it away while another stands in it, so empty ones may.
TEST(FolderSwap, ProcessesThatTryFoldersBesideOneAnotherDoNotDisturbEachOther) {
  const TemporaryFolder folder;
  const auto outcome = run_in_child([&] {
    std::vector<pid_t> children;
    for (char letter = 'a'; letter < 'e'; ++letter) {
      children.push_back(::fork());
      if (children.back() != 0) continue;
      const fs::path place = folder.path() / "in" / "between" / std::string(1, letter);
      std::string fault;
      for (int i = 0; i < 300 && fault.empty(); ++i) fault = fault_of([&] { const FolderSwap tried(place); });
      if (!fault.empty()) std::printf("%s\n", fault.c_str());
      std::fflush(stdout);
      ::_exit(0);
    }
    for (const pid_t child : children) ::waitpid(child, nullptr, 0);
    return 0;
  });
  EXPECT_EQ(outcome.out, "");
  for (const auto& [name, content] : content_of(folder.path())) {
    EXPECT_EQ(content, "a folder") << name;
    EXPECT_THAT(name, ::testing::Not(HasSubstr(".alidade-")));
  }
}

TEST(FolderSwap, AFileBeyondTheLimitLeavesNothing) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a", "old");
  const auto outcome = run_in_child([&] {
    const rlimit limit{1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, SIG_IGN);
    return fault_of([&] {
             FolderSwap swap(folder.path());
             swap.add("a", std::string(500, 'n'));
             swap.add("b", std::string(2000, 'n'));
             swap.commit();
           }).find("b: cannot be written: File too large") != std::string::npos
               ? 7
               : 0;
  });
  EXPECT_EQ(outcome.code, 7);
  EXPECT_EQ(content_of(folder.path()), (Content{{"a", "old"}}));
}

TEST(FolderSwap, AFullDiskLeavesWhatWasThere) {
  const TemporaryFolder folder;
  if (::mount("none", folder.path().c_str(), "tmpfs", 0, "size=256k") != 0) GTEST_SKIP() << "may not mount";
  write_file(folder.path() / "a", "old");
  write_file(folder.path() / "gone", "old");
  const Content before = content_of(folder.path());
  for (const std::size_t bytes : {10'000u, 50'000u, 120'000u, 300'000u}) {
    const std::string fault = fault_of([&] {
      FolderSwap swap(folder.path());
      for (const char* name : {"a", "b", "c", "d", "e"}) swap.add(name, std::string(bytes, 'n'));
      swap.remove("gone");
      if (bytes == 10'000) return;
      swap.commit();
    });
    EXPECT_EQ(fault.empty(), bytes == 10'000) << "they have room, and are not committed";
    if (!fault.empty()) EXPECT_THAT(fault, HasSubstr("No space left on device"));
    EXPECT_EQ(content_of(folder.path()), before);
  }
  ::umount(folder.path().c_str());
}

}  // namespace
}  // namespace alidade
