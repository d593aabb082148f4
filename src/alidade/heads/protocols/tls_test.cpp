// A server that others made, openssl s_server, whose certificate is its own.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/line_socket.h"
#include "alidade/heads/protocols/onvif_service.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

int unused_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ::bind(socket, reinterpret_cast<sockaddr*>(&address), size);
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(socket);
  return ntohs(address.sin_port);
}

/// Answers each line with its letters in reverse order.
class ReversingServer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("openssl version >/dev/null 2>&1") != 0) GTEST_SKIP() << "openssl is not installed: openssl";
    std::filesystem::create_directories(folder_);
    ASSERT_EQ(std::system(("openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=a-camera -keyout " + key() +
                           " -out " + certificate() + " >/dev/null 2>&1")
                              .c_str()),
              0);
    server_ = ::fork();
    if (server_ == 0) {
      const std::string port = "127.0.0.1:" + std::to_string(port_);
      // Not closed: the server's own words would go to the socket that got their number.
      const int nowhere = ::open("/dev/null", O_WRONLY);
      ::dup2(nowhere, STDOUT_FILENO);
      ::dup2(nowhere, STDERR_FILENO);
      ::execlp("openssl", "openssl", "s_server", "-accept", port.c_str(), "-key", key().c_str(), "-cert",
               certificate().c_str(), "-rev", "-quiet", nullptr);
      ::_exit(127);
    }
    for (int i = 0; i < 100 && !answers(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  void TearDown() override {
    if (server_ > 0) {
      ::kill(server_, SIGKILL);
      ::waitpid(server_, nullptr, 0);
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  [[nodiscard]] std::string key() const { return folder_ / "key.pem"; }
  [[nodiscard]] std::string certificate() const { return folder_ / "cert.pem"; }
  [[nodiscard]] SocketAddress address() const {
    return {.name = "the camera", .user = "", .host = "127.0.0.1", .port = static_cast<std::uint16_t>(port_)};
  }
  [[nodiscard]] bool answers() const {
    try {
      LineSocket(address(), 1.0).connect();
      return true;
    } catch (const InputError&) {
      return false;
    }
  }
  /// What stands in the way of a connection that believes by that; empty: nothing.
  [[nodiscard]] std::string fault(const TlsTrust& trust) const {
    LineSocket socket(address(), 3.0);
    socket.encrypt(trust);
    try {
      socket.connect();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("alidade-tls-" + std::to_string(::getpid()));
  int port_ = unused_port();
  pid_t server_ = -1;
};

TEST_F(ReversingServer, IsBelievedByItsFingerprintAlone) {
  const std::string unknown = fault({"127.0.0.1", ""});
  EXPECT_THAT(unknown, HasSubstr("the camera: its certificate is not trusted (self"));
  std::smatch found;
  ASSERT_TRUE(std::regex_search(unknown, found, std::regex("cert=([0-9a-f]{64}) ")));
  const std::string fingerprint = found[1];
  // The same by openssl's own means.
  const std::filesystem::path said = folder_ / "said";
  ASSERT_EQ(
      std::system(("openssl x509 -in " + certificate() + " -noout -fingerprint -sha256 > " + said.string()).c_str()),
      0);
  std::string theirs = read_file(said);
  std::erase(theirs, ':');
  for (char& letter : theirs) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  EXPECT_THAT(theirs, HasSubstr(fingerprint));
  EXPECT_THAT(fault({"127.0.0.1", std::string(64, '0')}), HasSubstr("another one than cert= says"));

  LineSocket socket(address(), 3.0);
  socket.encrypt({"127.0.0.1", fingerprint});
  socket.connect();
  for (const std::string& text : {std::string("olleh"), std::string(9000, 'a') + "b"}) {
    socket.write(text + "\n");
    EXPECT_EQ(socket.line(), std::string(text.rbegin(), text.rend()));
  }
  socket.set_timeout(0.2);
  EXPECT_THROW((void)socket.line(), InputError);  // nothing comes
}

TEST(OnvifTrust, IsAskedForInTheAddress) {
  EXPECT_FALSE(onvif_trust("onvif://me@camera/?profile=0"));
  EXPECT_EQ(onvif_trust("onvif://me@camera/?profile=0&https=1")->host, "camera");
  const std::string digits = "00:11:22:33:44:55:66:77:88:99:AA:BB:CC:DD:EE:FF";
  EXPECT_EQ(onvif_trust("onvif://me@camera/?cert=" + digits + ":" + digits)->fingerprint,
            "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff");
  EXPECT_THROW((void)onvif_trust("onvif://me@camera/?cert=1234"), InputError);
}

}  // namespace
}  // namespace alidade
