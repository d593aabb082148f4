#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/live/foxglove.h"
#include "alidade/live/server.h"

namespace alidade::live {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string bytes(std::initializer_list<int> values) {
  std::string text;
  for (const int value : values) text += static_cast<char>(value);
  return text;
}

TEST(Protocol, MessagesHaveTheLayoutOfTheSpecification) {
  // By hand: opcode 1, subscription 0x01020304, 1 s + 2 ns = 0x3B9ACA02, each little-endian.
  EXPECT_EQ(message_head(0x01020304U, 1'000'000'002U), bytes({1, 4, 3, 2, 1, 0x02, 0xca, 0x9a, 0x3b, 0, 0, 0, 0}));
  EXPECT_EQ(time_bytes(0x0102030405060708U), bytes({2, 8, 7, 6, 5, 4, 3, 2, 1}));
}

TEST(Protocol, GreetingsAreWhatClientsRead) {
  const auto info = nlohmann::json::parse(server_info_text("alidade", "s1"));
  EXPECT_EQ(info, nlohmann::json::parse(R"({"op":"serverInfo","name":"alidade","capabilities":["time"],
      "supportedEncodings":[],"metadata":{},"sessionId":"s1"})"));
  const std::array<Channel, 1> channels{Channel{"/track", "alidade.TrackStep", R"({"type":"object"})"}};
  EXPECT_EQ(nlohmann::json::parse(advertise_text(channels)), nlohmann::json::parse(R"({"op":"advertise","channels":[
      {"id":1,"topic":"/track","encoding":"json","schemaName":"alidade.TrackStep","schema":"{\"type\":\"object\"}",
       "schemaEncoding":"jsonschema"}]})"));
}

TEST(Protocol, BothNamesAreSpokenAndTheNewerIsPreferred) {
  EXPECT_EQ(chosen_subprotocol("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(chosen_subprotocol("foxglove.websocket.v1, foxglove.sdk.v1"), "foxglove.sdk.v1");
  EXPECT_EQ(chosen_subprotocol(" foxglove.sdk.v1"), "foxglove.sdk.v1");
  for (const char* other : {"", "foxglove.sdk.v2", "chat,superchat", ",,,"})
    EXPECT_EQ(chosen_subprotocol(other), std::nullopt);
}

TEST(Protocol, OnlyItsOwnNamesAreHosts) {
  for (const char* own : {"127.0.0.1:8765", "localhost:8765", "LOCALHOST:8765", "[::1]:8765"})
    EXPECT_TRUE(is_own_host(own, "127.0.0.1", 8765)) << own;
  for (const char* foreign : {"", "evil.example:8765", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.example:8765",
                              "localhost.evil.example:8765", "192.168.0.2:8765", "[::1"})
    EXPECT_FALSE(is_own_host(foreign, "127.0.0.1", 8765)) << foreign;
  EXPECT_TRUE(is_own_host("192.168.0.2:9000", "0.0.0.0", 9000));
  EXPECT_TRUE(is_own_host("robot.local:9000", "0.0.0.0", 9000, "robot"));
  EXPECT_FALSE(is_own_host("evil.example:9000", "0.0.0.0", 9000, "robot"));
  EXPECT_FALSE(is_own_host("192.168.0.2:9000", "10.0.0.1", 9000));
}

TEST(Protocol, TokensAreWhole) {
  EXPECT_TRUE(has_token("/?token=abc", "abc"));
  EXPECT_TRUE(has_token("/result.json?a=b&token=abc", "abc"));
  for (const char* target :
       {"/", "/?token=", "/?token=abd", "/?token=abcd", "/?token=ab", "/token=abc", "/?xtoken=abc"})
    EXPECT_FALSE(has_token(target, "abc")) << target;
}

Outgoing message(MessageKind kind, char name, std::size_t size, std::uint32_t replaces = 0) {
  return {kind, false, std::string(size, name), nullptr, replaces};
}

std::string names_in(SendQueue& queue) {
  std::string names;
  while (!queue.is_empty()) names += queue.pop().head.front();
  return names;
}

TEST(SendQueue, DropsTheOldestImagesThenTheOldestSteps) {
  SendQueue queue(100);
  queue.push(message(MessageKind::control, 'c', 10));
  queue.push(message(MessageKind::step, 's', 20));
  queue.push(message(MessageKind::image, 'i', 40));
  queue.push(message(MessageKind::step, 't', 20));
  queue.push(message(MessageKind::image, 'j', 40));  // 130 bytes: i goes
  EXPECT_EQ(queue.bytes(), 90U);
  queue.push(message(MessageKind::step, 'u', 60));     // 150: j goes, then s
  queue.push(message(MessageKind::control, 'd', 30));  // 120: t goes; what controls stays whatever comes
  const SendQueue::Dropped dropped = queue.take_dropped();
  EXPECT_EQ(dropped.images, 2U);
  EXPECT_EQ(dropped.steps, 2U);
  EXPECT_FALSE(queue.has_dropped());
  EXPECT_EQ(names_in(queue), "cud");
}

TEST(SendQueue, WhatReplacesTakesOutItsOlderSelf) {
  SendQueue queue(100);
  queue.push(message(MessageKind::control, 'a', 90, 7));
  queue.push(message(MessageKind::step, 's', 5));
  queue.push(message(MessageKind::control, 'b', 90, 7));
  EXPECT_EQ(queue.bytes(), 95U);
  EXPECT_EQ(names_in(queue), "sb");
}

TEST(RateLimit, NoSecondHasMoreAndSlowerStreamsPassWhole) {
  for (const double hz : {10.0, 59.0, 200.0, 5000.0}) {
    RateLimit limit(60.0);
    std::vector<double> passed;
    std::size_t num_asked = 0;
    for (double t = 0.0; t < 5.0; t += 1.0 / hz, ++num_asked)
      if (limit.lets_through(t)) passed.push_back(t);
    std::size_t most = 0;
    for (std::size_t i = 0, j = 0; i < passed.size(); ++i) {
      while (passed[i] - passed[j] >= 1.0) ++j;
      most = std::max(most, i - j + 1);
    }
    EXPECT_LE(most, 60U) << hz;
    if (hz < 60.0) {
      EXPECT_EQ(passed.size(), num_asked);
    }
    if (hz > 60.0) {
      EXPECT_GE(passed.size(), 280U) << hz;  // nearly all that may pass do
    }
  }
}

Topic rows(const char* name = "/rows") { return {{name, "alidade.Row", "{}"}, TopicKind::steps, 60.0, 1}; }

std::string all_of(Feed& feed) {
  std::string text;
  while (feed.has_next()) {
    const Outgoing next = feed.next();
    text += next.head + (next.body ? *next.body : "") + "\n";
  }
  return text;
}

TEST(Feed, BrokenRequestsAreAnsweredAndNothingElseHappens) {
  const TopicStore topics({rows()});
  const std::vector<std::string> broken{"",
                                        "{",
                                        "[]",
                                        "null",
                                        R"({"op":7})",
                                        R"({"op":"subscribe"})",
                                        R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})",
                                        R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})",
                                        R"({"op":"subscribe","subscriptions":[{"id":1e300,"channelId":1}]})",
                                        R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]})",
                                        R"({"op":"unsubscribe","subscriptionIds":[5]})",
                                        R"({"op":"advertise","channels":[]})",
                                        std::string(100'000, '['),
                                        "\xff\xfe\x00"};
  for (const std::string& text : broken) {
    Feed feed(topics, "s");
    all_of(feed);
    feed.hear(text);
    EXPECT_THAT(all_of(feed), HasSubstr(R"("op":"status","level":1)")) << text.substr(0, 60);
    EXPECT_FALSE(feed.subscribes_to(0)) << text.substr(0, 60);
  }
}

TEST(Feed, LateClientsGetTheLastMinuteAndTheirOwnSubscription) {
  TopicStore topics({rows(), {{"/scene", "x", "{}"}, TopicKind::latest, 10.0, 1}});
  for (int i = 0; i < 100; ++i) {
    const KeptMessage kept{static_cast<std::uint64_t>(i), static_cast<double>(i),
                           std::make_shared<const std::string>("row " + std::to_string(i))};
    topics.keep(0, kept);
    topics.keep(1, kept);
  }
  Feed feed(topics, "s");
  all_of(feed);
  feed.hear(R"({"op":"subscribe","subscriptions":[{"id":9,"channelId":1},{"id":3,"channelId":2}]})");
  EXPECT_EQ(topics.kept(0).size(), 61U);  // 39 … 99: not older than 60 s
  EXPECT_EQ(topics.kept(1).size(), 1U);
  EXPECT_EQ(feed.next().head, message_head(9, 39));
  const std::string rest = all_of(feed);
  EXPECT_THAT(rest, HasSubstr(message_head(3, 99) + "row 99"));
  EXPECT_THAT(rest, Not(HasSubstr(message_head(3, 98))));
}

TEST(Feed, AClientThatDoesNotReadCostsFourMegabytesAndIsWarned) {
  TopicStore topics({rows()});
  Feed feed(topics, "s");
  feed.hear(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":1}]})");
  const auto body = std::make_shared<const std::string>(1000, 'x');
  for (int i = 0; i < 20'000; ++i) {
    feed.offer(0, {static_cast<std::uint64_t>(i), 0.0, body});
    feed.note_dropped(1e-3 * i);  // 20 s of them
    ASSERT_LE(feed.queue().bytes(), 4'000'000U);
  }
  const std::string text = all_of(feed);
  EXPECT_THAT(text, HasSubstr("this client reads too slowly"));
  EXPECT_THAT(text, HasSubstr(message_head(1, 19'999)));  // the newest is there
}

/// A plain socket on the loopback, whose reads give up after two seconds.
class Wire {
 public:
  explicit Wire(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval patience{2, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  }
  ~Wire() { ::close(socket_); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;
  void send(const std::string& text) const { (void)::send(socket_, text.data(), text.size(), MSG_NOSIGNAL); }
  /// Until the text is there, the other side closes, or two seconds have passed.
  std::string read_until(const std::string& text) const {
    std::string all;
    char part[4096];
    while (all.find(text) == std::string::npos) {
      const ssize_t count = ::recv(socket_, part, sizeof part, 0);
      if (count <= 0) break;
      all.append(part, static_cast<std::size_t>(count));
    }
    return all;
  }

 private:
  int socket_;
};

ServerConfig config_of(std::vector<Topic> topics) {
  ServerConfig config;
  config.port = 0;
  config.topics = std::move(topics);
  config.get = [](std::string_view path) {
    return path == "/" ? HttpAnswer{200, "text/html", "the page"} : HttpAnswer{};
  };
  return config;
}

std::string request(const std::string& method, const std::string& target, const std::string& host,
                    const std::string& more = "") {
  return method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n";
}

std::string upgrade(const std::string& protocols) {
  return "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
         "dGhlIHNhbXBsZSBub25jZQ==\r\n" +
         (protocols.empty() ? "" : "Sec-WebSocket-Protocol: " + protocols + "\r\n");
}

std::string answer(const Server& server, const std::string& request, const std::string& until = "\r\n\r\n") {
  const Wire wire(server.port());
  wire.send(request);
  return wire.read_until(until);
}

TEST(Server, AnswersItsOwnHostAndNoOther) {
  const Server server(config_of({rows()}));
  const std::string host = "127.0.0.1:" + std::to_string(server.port());
  EXPECT_EQ(server.url(), "http://" + host + "/");
  EXPECT_THAT(answer(server, request("GET", "/", host), "the page"), HasSubstr("the page"));
  EXPECT_THAT(answer(server, request("GET", "/none", host)), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(answer(server, request("GET", "/", "evil.example")), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(answer(server, request("POST", "/", host)), StartsWith("HTTP/1.1 405"));
  EXPECT_THAT(answer(server, request("GET", "/", "evil.example", upgrade("foxglove.sdk.v1"))),
              StartsWith("HTTP/1.1 403"));
}

TEST(Server, ShakesHandsUnderBothNames) {
  const Server server(config_of({rows()}));
  const std::string host = "127.0.0.1:" + std::to_string(server.port());
  for (const char* name : {"foxglove.sdk.v1", "foxglove.websocket.v1"}) {
    const std::string said = answer(server, request("GET", "/", host, upgrade(name)), "advertise");
    EXPECT_THAT(said, StartsWith("HTTP/1.1 101"));
    EXPECT_THAT(said, HasSubstr(std::string("Sec-WebSocket-Protocol: ") + name));
    EXPECT_THAT(said, HasSubstr("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));  // of the key: RFC 6455, section 1.3
    EXPECT_THAT(said, HasSubstr(R"("op":"serverInfo")"));
  }
  EXPECT_THAT(answer(server, request("GET", "/", host, upgrade("chat"))), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(answer(server, request("GET", "/", host, upgrade(""))), StartsWith("HTTP/1.1 400"));
}

TEST(Server, BrokenInputEndsNothing) {
  Server server(config_of({rows()}));
  const std::string host = "127.0.0.1:" + std::to_string(server.port());
  const std::string open = request("GET", "/", host, upgrade("foxglove.sdk.v1"));
  for (const std::string& broken : {std::string("\0\1\2", 3), std::string("GET\r\n\r\n"), std::string(20'000, 'A'),
                                    "GET / HTTP/1.1\r\nHost: " + host, open + bytes({0x81, 0x85, 0, 0, 0, 0}) + "hello",
                                    open + bytes({0x81, 0x05}) + "naked",
                                    open + bytes({0x82, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff}),
                                    open + std::string(5'000, '\xff')}) {
    const Wire wire(server.port());
    wire.send(broken);
  }
  for (int i = 0; i < 100; ++i) server.send("/rows", i, [] { return std::string("{}"); });
  EXPECT_THAT(answer(server, request("GET", "/", host), "the page"), HasSubstr("the page"));
}

TEST(Server, ServesEightClients) {
  const Server server(config_of({rows()}));
  const std::string open =
      request("GET", "/", "127.0.0.1:" + std::to_string(server.port()), upgrade("foxglove.sdk.v1"));
  std::vector<std::unique_ptr<Wire>> wires;
  for (int i = 0; i < 8; ++i) {
    wires.push_back(std::make_unique<Wire>(server.port()));
    wires.back()->send(open);
    EXPECT_THAT(wires.back()->read_until("advertise"), StartsWith("HTTP/1.1 101"));
  }
  EXPECT_THAT(answer(server, open), StartsWith("HTTP/1.1 503"));
}

TEST(Server, SaysWhereItCannotListen) {
  const Server first(config_of({}));
  ServerConfig config = config_of({});
  config.port = first.port();
  EXPECT_THAT([&] { const Server second(config); },
              ::testing::ThrowsMessage<InputError>(HasSubstr("is in use; give another one")));
  config.address = "here";
  EXPECT_THROW({ const Server third(config); }, InputError);
}

TEST(Foxglove, EllipsoidsHaveSixSigmaAndTheirAxes) {
  // σ 1, 2 and 3 cm along the axes: full axes of 6, 12 and 18 cm, in order of size.
  Scene scene(1'500'000'000, "world");
  scene.ellipsoid("target", {1.0, 2.0, 3.0}, Eigen::Vector3d(9e-4, 4e-4, 1e-4).asDiagonal().toDenseMatrix(), orange);
  const auto json = nlohmann::json::parse(scene.text());
  const auto& entity = json["entities"][0];
  for (const char* list : {"arrows", "cubes", "cylinders", "lines", "triangles", "texts", "models", "metadata"})
    EXPECT_TRUE(entity[list].is_array() && entity[list].empty()) << list;
  EXPECT_EQ(entity["timestamp"], nlohmann::json::parse(R"({"sec":1,"nsec":500000000})"));
  const auto& sphere = entity["spheres"][0];
  EXPECT_NEAR(sphere["size"]["x"].get<double>(), 0.06, 1e-12);
  EXPECT_NEAR(sphere["size"]["z"].get<double>(), 0.18, 1e-12);
  const auto& q = sphere["pose"]["orientation"];
  const Eigen::Quaterniond rotation(q["w"], q["x"], q["y"], q["z"]);
  EXPECT_NEAR(std::abs((rotation * Eigen::Vector3d::UnitZ()).x()), 1.0, 1e-9);  // the longest axis is the world's x
}

TEST(Foxglove, CalibrationsNameTheLensAsRosDoes) {
  Camera camera{640, 480, *make_lens("brown"), {}, 0.0, ""};
  Eigen::VectorXd values = params(camera.lens);
  const std::vector<std::string> names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) values[static_cast<Eigen::Index>(i)] = 10.0 + static_cast<double>(i);
  camera.lens = with_params(camera.lens, values);
  const auto value = [&](const std::string& name) { return values[std::ranges::find(names, name) - names.begin()]; };
  const auto json = nlohmann::json::parse(camera_calibration_text(0, "head1", camera));
  EXPECT_EQ(json["distortion_model"], "plumb_bob");
  EXPECT_EQ(json["D"], (std::vector<double>{value("k1"), value("k2"), value("p1"), value("p2"), value("k3")}));
  EXPECT_EQ(json["K"][0], value("fx"));
  EXPECT_EQ(json["K"][4], value("fy"));
  EXPECT_EQ(json["P"][6], value("cy"));
}

}  // namespace
}  // namespace alidade::live
