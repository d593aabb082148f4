#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <regex>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/line_socket.h"
#include "alidade/heads/protocols/onvif_service.h"
#include "alidade/testing/tls_server.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

class ReversingServer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::TlsServer::is_installed()) GTEST_SKIP() << "openssl is not installed: openssl";
    server_.emplace("-rev");
  }
  [[nodiscard]] SocketAddress address() const {
    return {.name = "the camera", .user = "", .host = "127.0.0.1", .port = static_cast<std::uint16_t>(server_->port())};
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

  std::optional<testing::TlsServer> server_;
};

TEST_F(ReversingServer, IsBelievedByItsFingerprintAlone) {
  const std::string unknown = fault({"127.0.0.1", ""});
  EXPECT_THAT(unknown, HasSubstr("the camera: its certificate is not trusted (self"));
  std::smatch found;
  ASSERT_TRUE(std::regex_search(unknown, found, std::regex("cert=([0-9a-f]{64}) ")));
  const std::string fingerprint = found[1];
  // The same by openssl's own means.
  const std::filesystem::path said = server_->folder() / "said";
  ASSERT_EQ(
      std::system(
          ("openssl x509 -in " + server_->certificate() + " -noout -fingerprint -sha256 > " + said.string()).c_str()),
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
