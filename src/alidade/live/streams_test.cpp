#include "alidade/live/streams.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <ctime>
#include <thread>

#include "alidade/simulate/track.h"

namespace alidade::live {
namespace {

double thread_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Subscribes to every channel and never reads.
class DeafClient {
 public:
  DeafClient(std::uint16_t port, std::size_t num_channels) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
    send("GET / HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
         "\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
         "dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n");
    std::string all = R"({"op":"subscribe","subscriptions":[)";
    for (std::size_t i = 0; i < num_channels; ++i)
      all += (i > 0 ? "," : "") + std::string(R"({"id":)") + std::to_string(i + 1) + R"(,"channelId":)" +
             std::to_string(i + 1) + "}";
    all += "]}";
    std::string frame{'\x81', '\xfe', static_cast<char>(all.size() >> 8), static_cast<char>(all.size() & 255)};
    send(frame + std::string(4, '\0') + all);  // masked by zeros
  }
  ~DeafClient() { ::close(socket_); }
  DeafClient(const DeafClient&) = delete;
  DeafClient& operator=(const DeafClient&) = delete;

 private:
  void send(const std::string& text) const { (void)::send(socket_, text.data(), text.size(), MSG_NOSIGNAL); }
  int socket_;
};

/// Two heads at 30 images a second and four clients that do not read: the estimator's own thread spends less than a
/// hundredth of its time on showing them what it does.
TEST(TrackStream, CostsTheEstimatorLessThanOnePercent) {
  const std::array<RigHead, 2> heads = xiahou_rig();
  const TrueTrack truth;
  const TrackStream stream(heads, truth);
  ServerConfig config;
  config.port = 0;
  config.topics = stream.topics();
  const std::size_t num_topics = config.topics.size();
  Server server(std::move(config));
  std::vector<std::unique_ptr<DeafClient>> clients;
  for (int i = 0; i < 4; ++i) clients.push_back(std::make_unique<DeafClient>(server.port(), num_topics));
  for (int i = 0; i < 200 && server.num_clients() < 4; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_EQ(server.num_clients(), 4u);
  TrackStep step;
  step.has_belief = step.has_innovation = step.accepted = true;
  step.belief.x << 0.1, 0.2, 0.8, 0.0, 0.0, 0.0;
  step.belief.P.setIdentity();
  step.innovation.S.setIdentity();
  constexpr int num_images = 45;
  double spent_s = 0.0;
  for (int i = 0; i < num_images; ++i) {
    for (std::size_t head = 0; head < 2; ++head) {
      const double t_s = i / 30.0, from_s = thread_s();
      stream.show(server, {t_s, t_s, head, Eigen::Vector2d::Zero(), Eigen::Vector2d(300, 200), 0.0}, step);
      spent_s += thread_s() - from_s;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(33'333));
  }
  RecordProperty("share", std::to_string(spent_s / (num_images / 30.0)));
  EXPECT_LT(spent_s, 0.01 * num_images / 30.0) << "of " << num_images / 30.0 << " s";
}

}  // namespace
}  // namespace alidade::live
