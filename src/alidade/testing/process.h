#pragma once

#include <fcntl.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "alidade/files/files.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade::testing {

/// What a process left: exit code (128 + signal where it was killed) and what it wrote.
struct Outcome {
  int code = -1;
  std::string out;
  std::string err;
};

/// Runs `body` in a child process whose exit code is what it returns; `meanwhile` runs here with its id.
[[nodiscard]] inline Outcome run_in_child(const std::function<int()>& body,
                                          const std::function<void(pid_t)>& meanwhile = {}) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string(), err = (folder.path() / "err").string();
  // Made here: a child may be killed before it has done anything.
  const int to_out = ::open(out.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  const int to_err = ::open(err.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(to_out, STDOUT_FILENO);
    ::dup2(to_err, STDERR_FILENO);
    const int code = body();
    std::fflush(nullptr);
    ::_exit(code);
  }
  ::close(to_out);
  ::close(to_err);
  if (child < 0) throw std::runtime_error("fork failed");
  if (meanwhile) meanwhile(child);
  int status = 0;
  ::waitpid(child, &status, 0);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(out), read_file(err)};
}

/// Runs a program with arguments; `folder`: where, unless empty.
[[nodiscard]] inline Outcome run_program(std::vector<std::string> words, const std::string& folder = "",
                                         const std::function<void(pid_t)>& meanwhile = {}) {
  const auto body = [&] {
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    if (!folder.empty() && ::chdir(folder.c_str()) != 0) return 127;
    ::execvp(argv[0], argv.data());
    return 127;
  };
  return run_in_child(body, meanwhile);
}

/// Sends SIGINT so long after the process has begun to listen for it, however slow the machine; after 60 s in any case.
[[nodiscard]] inline std::function<void(pid_t)> interrupt_after(std::chrono::milliseconds wait) {
  return [wait](pid_t child) {
    const std::string status = "/proc/" + std::to_string(child) + "/status";
    const auto listens = [&] {
      std::ifstream lines(status);
      for (std::string line; std::getline(lines, line);) {
        if (!line.starts_with("SigCgt:")) continue;
        return (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1u) != 0u;
      }
      return false;
    };
    for (int i = 0; i < 3000 && !listens(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::this_thread::sleep_for(wait);
    ::kill(child, SIGINT);
  };
}

/// Runs `body` in a child process on a terminal of its own and gives everything that the terminal showed.
[[nodiscard]] inline std::string shown_on_terminal(const std::function<int()>& body) {
  int master = -1;
  std::fflush(nullptr);
  const pid_t child = ::forkpty(&master, nullptr, nullptr, nullptr);
  if (child < 0) throw std::runtime_error("forkpty failed");
  if (child == 0) {
    const int code = body();
    std::fflush(nullptr);
    ::_exit(code);
  }
  std::string shown;
  char chunk[4096];
  for (ssize_t got = 0; (got = ::read(master, chunk, sizeof chunk)) > 0;)
    shown.append(chunk, static_cast<std::size_t>(got));
  ::close(master);
  ::waitpid(child, nullptr, 0);
  return shown;
}

}  // namespace alidade::testing
