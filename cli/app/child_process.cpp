#include "cli/app/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <string_view>
#include <thread>

#include "alidade/files/descriptor.h"
#include "alidade/files/files.h"

namespace alidade::cli {
namespace {

constexpr std::size_t kept_bytes = 4096;
constexpr int ask_every_ms = 100;
constexpr int patience = 50;  // times that long, until what does not end by TERM is killed

pid_t start_child(const std::string& program, std::vector<std::string> words, int error_pipe) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, error_pipe, STDERR_FILENO);
  // A group of its own: Ctrl-C is this program's to pass on.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  std::string name = program;
  std::vector<char*> argv{name.data()};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t process = -1;
  const int error = posix_spawn(&process, program.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) fail_on(program, "cannot be started", error);
  return process;
}

}  // namespace

std::filesystem::path own_executable() {
  std::error_code error;
  std::string name = std::filesystem::read_symlink("/proc/self/exe", error).string();
  // The executable was replaced during a batch, by an upgrade: the new one continues.
  constexpr std::string_view gone = " (deleted)";
  if (name.ends_with(gone)) name.resize(name.size() - gone.size());
  return name;
}

ChildResult run_child(const std::filesystem::path& program, const std::vector<std::string>& words,
                      const std::function<bool()>& goes_on) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail_on(program, "no pipe", errno);
  const Descriptor from(ends[0]);
  pid_t process = -1;
  {
    const Descriptor to(ends[1]);
    process = start_child(program.string(), words, to.number());
  }
  ChildResult result;
  std::array<char, 4096> chunk{};
  for (int asked = 0;;) {
    struct pollfd waiting {
      from.number(), POLLIN, 0
    };
    const int ready = ::poll(&waiting, 1, ask_every_ms);
    if (ready > 0) {
      const ssize_t got = ::read(from.number(), chunk.data(), chunk.size());
      if (got == 0) break;
      if (got > 0) result.errors.append(chunk.data(), static_cast<std::size_t>(got));
      if (result.errors.size() > 2 * kept_bytes) result.errors.erase(0, result.errors.size() - kept_bytes);
    }
    if (goes_on()) continue;
    result.is_stopped = true;
    ::kill(process, asked++ < patience ? SIGTERM : SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(asked > 1 ? ask_every_ms : 0));
  }
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

}  // namespace alidade::cli
