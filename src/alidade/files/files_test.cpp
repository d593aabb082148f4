#include "alidade/files/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <thread>
#include <vector>

#include "alidade/testing/fault.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

std::string fault_of_reading(const std::filesystem::path& file) {
  return fault_of([&] { (void)read_file(file); });
}

std::string fault_of_writing(const std::filesystem::path& file) {
  return fault_of([&] { write_file(file, "x"); });
}

std::size_t num_entries(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(Files, WrittenBytesAreReadBack) {
  const TemporaryFolder folder;
  std::string bytes;
  for (int i = 0; i < 300'000; ++i) bytes += static_cast<char>(i % 256);
  write_file(folder.path() / "a", bytes);
  EXPECT_EQ(read_file(folder.path() / "a"), bytes);
}

TEST(Files, WritingMakesFoldersAndReplacesWhole) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "deep" / "er" / "file.txt";
  write_file(file, "a long first content");
  write_file(file, "second");
  EXPECT_EQ(read_file(file), "second");
  EXPECT_EQ(num_entries(file.parent_path()), 1u) << "a temporary file was left";
}

// As root `camera convert … /dev/full` left a file there.
TEST(Files, WhatIsNoFileIsWrittenToAndALinkStays) {
  const TemporaryFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe", link = folder.path() / "link";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string got;
  std::thread reader([&] { got = read_file(pipe); });
  write_file(pipe, "through");
  reader.join();
  EXPECT_EQ(got, "through");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  write_file(folder.path() / "target", "old");
  std::filesystem::create_symlink("target", link);
  write_file(link, "new");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(read_file(folder.path() / "target"), "new");
  EXPECT_THAT(fault_of_writing("/dev/full"), HasSubstr("/dev/full: cannot be written"));
}

TEST(Files, AFileInTheCurrentFolderIsWrittenByItsBareName) {
  const TemporaryFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  write_file("bare.txt", "x");
  std::filesystem::current_path(before);
  EXPECT_EQ(read_file(folder.path() / "bare.txt"), "x");
}

TEST(Files, FaultsNameTheFileAndTheReason) {
  const TemporaryFolder folder;
  write_file(folder.path() / "file", "x");
  EXPECT_EQ(fault_of_reading("no/such.csv"), "no/such.csv: cannot be read: No such file or directory");
  EXPECT_THAT(fault_of_reading(folder.path()), HasSubstr("is a folder, not a file"));
  EXPECT_THAT(fault_of_writing(folder.path()), HasSubstr("is a folder, not a file"));
  EXPECT_THAT(fault_of_writing(folder.path() / "file" / "below"), HasSubstr("cannot be written: Not a directory"));
}

TEST(Files, AFailedWriteLeavesTheOldContentAndNoOtherFile) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "file";
  write_file(file, "old");
  const pid_t child = ::fork();
  if (child == 0) {  // a disk that is full, as seen by one process
    const rlimit small{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &small);
    ::signal(SIGXFSZ, SIG_IGN);
    try {
      write_file(file, std::string(1 << 20, 'x'));
    } catch (const InputError&) {
      ::_exit(3);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 3);
  EXPECT_EQ(read_file(file), "old");
  EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(Files, ReadersNeverSeeAHalfWrittenFileThoughTheWriterIsKilled) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "file";
  const std::string big(8 << 20, 'x');
  write_file(file, big);
  int num_killed = 0;
  for (int i = 0; i < 10; ++i) {
    const pid_t child = ::fork();
    if (child == 0) {
      while (true) write_file(file, big);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5 + 3 * i));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    ++num_killed;
    ASSERT_EQ(std::filesystem::file_size(file), big.size());
  }
  EXPECT_EQ(num_killed, 10);
}

TEST(Files, ThreadsThatWriteTheSameFileLeaveOneOfTheirContents) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "file";
  std::vector<std::thread> threads;
  for (char c = 'a'; c < 'e'; ++c) {
    threads.emplace_back([&file, c] {
      for (int i = 0; i < 20; ++i) write_file(file, std::string(10'000, c));
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::string content = read_file(file);
  EXPECT_EQ(content, std::string(10'000, content.at(0)));
  EXPECT_EQ(num_entries(folder.path()), 1u);
}

}  // namespace
}  // namespace alidade
