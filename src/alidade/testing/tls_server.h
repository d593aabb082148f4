#pragma once

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "alidade/testing/temporary_folder.h"

namespace alidade::testing {

/// A server that others made, openssl s_server, in a folder of its own, whose certificate is its own, for 127.0.0.1.
class TlsServer {
 public:
  [[nodiscard]] static bool is_installed() { return std::system("openssl version >/dev/null 2>&1") == 0; }

  /// `kind`: "-rev" answers each line with its letters in reverse order, "-WWW" sends the files of its folder.
  explicit TlsServer(const std::string& kind) {
    const std::string make = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=a-camera -addext " +
                             std::string("subjectAltName=IP:127.0.0.1 -keyout ") + key() + " -out " + certificate() +
                             " >/dev/null 2>&1";
    if (std::system(make.c_str()) != 0) throw std::runtime_error("openssl makes no certificate");
    server_ = ::fork();
    if (server_ == 0) serve(kind);
    for (int i = 0; i < 100 && !answers(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  TlsServer(const TlsServer&) = delete;
  TlsServer& operator=(const TlsServer&) = delete;
  ~TlsServer() {
    if (server_ <= 0) return;
    ::kill(server_, SIGKILL);
    ::waitpid(server_, nullptr, 0);
  }

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }
  [[nodiscard]] std::string certificate() const { return folder() / "cert.pem"; }
  [[nodiscard]] int port() const { return port_; }

 private:
  [[nodiscard]] std::string key() const { return folder() / "key.pem"; }

  [[nodiscard]] static sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    return address;
  }
  [[nodiscard]] static int unused_port() {
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    ::bind(socket, reinterpret_cast<sockaddr*>(&address), size);
    ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
    ::close(socket);
    return ntohs(address.sin_port);
  }
  [[nodiscard]] bool answers() const {
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = loopback(port_);
    const bool does = ::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(socket);
    return does;
  }
  [[noreturn]] void serve(const std::string& kind) const {
    // Not closed: the server's own words would go to the socket that got their number.
    const int nowhere = ::open("/dev/null", O_WRONLY);
    ::dup2(nowhere, STDOUT_FILENO);
    ::dup2(nowhere, STDERR_FILENO);
    const std::string address = "127.0.0.1:" + std::to_string(port_);
    if (::chdir(folder().c_str()) == 0)
      ::execlp("openssl", "openssl", "s_server", "-accept", address.c_str(), "-key", key().c_str(), "-cert",
               certificate().c_str(), kind.c_str(), "-quiet", nullptr);
    ::_exit(127);
  }

  TemporaryFolder folder_;
  int port_ = unused_port();
  pid_t server_ = -1;
};

}  // namespace alidade::testing
