// Servers that answer a letter at a time, without end, with pages or with what is no number.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/head_survey.h"
#include "alidade/heads/protocols/indi_head.h"
#include "alidade/heads/protocols/onvif_head.h"
#include "alidade/heads/protocols/onvif_service.h"
#include "alidade/heads/protocols/rotctl_head.h"
#include "alidade/heads/protocols/soap.h"
#include "alidade/testing/fault.h"

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;
using ::testing::Not;

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// One connection after the other, each until `serve` returns.
class Server {
 public:
  using Serve = std::function<void(int socket, const std::atomic<bool>& ends)>;
  explicit Server(Serve serve) : serve_(std::move(serve)) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ::bind(listener_, reinterpret_cast<sockaddr*>(&address), size);
    ::listen(listener_, 8);
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { accept_all(); });
  }
  ~Server() {
    ends_ = true;
    thread_.join();
    ::close(listener_);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  [[nodiscard]] std::string place() const { return "127.0.0.1:" + std::to_string(port_); }

 private:
  void accept_all() {
    while (!ends_) {
      pollfd waiting{listener_, POLLIN, 0};
      if (::poll(&waiting, 1, 20) <= 0) continue;
      const int socket = ::accept(listener_, nullptr, nullptr);
      serve_(socket, ends_);
      ::close(socket);
    }
  }

  Serve serve_;
  int listener_ = -1, port_ = 0;
  std::atomic<bool> ends_ = false;
  std::thread thread_;
};

/// What has come within 20 ms; false at the end of the connection.
bool heard(int socket, std::string& text) {
  pollfd waiting{socket, POLLIN, 0};
  if (::poll(&waiting, 1, 20) <= 0) return true;
  char chunk[4096];
  const ssize_t got = ::recv(socket, chunk, sizeof chunk, 0);
  if (got > 0) text.append(chunk, static_cast<std::size_t>(got));
  return got > 0;
}
void say(int socket, const std::string& text) { (void)!::send(socket, text.data(), text.size(), MSG_NOSIGNAL); }

/// A camera: an answer of HTTP to each command by its name.
Server camera(const std::function<std::string(const std::string& request)>& answer) {
  return Server([answer](int socket, const std::atomic<bool>& ends) {
    std::string request;
    while (!ends && request.find("Envelope>") == std::string::npos)
      if (!heard(socket, request)) return;
    say(socket, answer(request));
  });
}
std::string http(int status, const std::string& body, const std::string& header = "") {
  return "HTTP/1.1 " + std::to_string(status) + " X\r\n" + header + "Content-Length: " + std::to_string(body.size()) +
         "\r\n\r\n" + body;
}
std::string soap(const std::string& inside) { return "<Envelope><Body>" + inside + "</Body></Envelope>"; }
const std::string page = "<html xmlns='http://www.w3.org/1999/xhtml'><body>An error</body></html>";

/// What a camera answers that is asked where it is.
std::string turning_camera(const std::string& request, const std::string& position, const std::string& limits = "") {
  if (request.find("<GetCapabilities") != std::string::npos)
    return http(200, soap("<r><Media><XAddr>http://x/m</XAddr></Media><PTZ><XAddr>http://x/p</XAddr></PTZ></r>"));
  if (request.find("<GetProfiles") != std::string::npos)
    return http(200, soap("<GetProfilesResponse><Profiles token='a'><PTZConfiguration token='p'>" + limits +
                          "</PTZConfiguration></Profiles></GetProfilesResponse>"));
  if (request.find("<GetStatus") != std::string::npos)
    return http(200, soap("<r><PTZStatus><Position>" + position + "</Position></PTZStatus></r>"));
  if (request.find("<AbsoluteMove") != std::string::npos) return http(500, page);
  return http(200, soap("<r/>"));
}

TEST(HostileLinks, AMountThatSaysMoreThanCanBeReadIsStoppedInTime) {
  std::atomic<double> moved_s = 0.0, aborted_s = 0.0;
  const Server mount([&](int socket, const std::atomic<bool>& ends) {
    std::string said;
    const std::string coordinates =
        "<oneNumber name='RA'>0.1</oneNumber><oneNumber name='DEC'>10</oneNumber></setNumberVector>";
    std::string noise;
    for (int i = 0; i < 4000; ++i) noise += "<message device='Mount'/>\n";  // short ones take longest to read
    bool is_known = false;
    while (!ends && heard(socket, said)) {
      if (!is_known && said.find("getProperties") != std::string::npos) {
        say(socket,
            "<defSwitchVector device='Mount' name='CONNECTION'><defSwitch name='CONNECT'>On</defSwitch>"
            "</defSwitchVector><defNumberVector device='Mount' name='EQUATORIAL_EOD_COORD' state='Ok'><defNumber "
            "name='RA'>0</defNumber><defNumber name='DEC'>10</defNumber></defNumberVector>");
        is_known = true;
      }
      if (said.find("newNumberVector") == std::string::npos) continue;
      if (moved_s == 0.0) {
        moved_s = seconds_now();
        say(socket, "<setNumberVector device='Mount' name='EQUATORIAL_EOD_COORD' state='Busy'>" + coordinates);
      }
      const double until_s = seconds_now() + 0.1;
      while (!ends && seconds_now() < until_s) {
        pollfd both{socket, POLLIN | POLLOUT, 0};
        if (::poll(&both, 1, 20) <= 0) continue;
        if ((both.revents & POLLIN) != 0 && !heard(socket, said)) return;
        if (said.find("ABORT") != std::string::npos) {
          aborted_s = seconds_now();
          return;
        }
        if ((both.revents & POLLOUT) != 0)
          (void)!::send(socket, noise.data(), noise.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      }
    }
  });
  const std::unique_ptr<HeadDevice> head = open_indi("indi://" + mount.place() + "/Mount", {});
  {
    MovingHead moving(*head, Eigen::Vector2d(-0.3, 0.0), Eigen::Vector2d(0.3, 0.5), {});
    (void)moving.position();
    moving.command({0.1, 0.2});
    const std::string fault = fault_of([&] {
      for (const double until_s = seconds_now() + 5.0; seconds_now() < until_s;) (void)moving.position();
    });
    EXPECT_THAT(fault, HasSubstr("says more than can be read"));
  }
  for (int i = 0; i < 100 && aborted_s == 0.0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_GT(aborted_s, 0.0) << "it was never stopped";
  EXPECT_LT(aborted_s - moved_s, 0.8);
}

TEST(HostileLinks, AnAnswerLetterByLetterIsNotWaitedFor) {
  const Server slow([](int socket, const std::atomic<bool>& ends) {
    std::string request;
    (void)heard(socket, request);
    say(socket, "HTTP/1.1 200 OK\r\n");
    for (int i = 0; i < 100 && !ends; ++i) {  // a line each, and each in time
      say(socket, "X: y\r\n");
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  });
  const Server dribbling([](int socket, const std::atomic<bool>& ends) {
    for (int i = 0; i < 10000 && !ends; ++i) {
      say(socket, "1");
      std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  });
  const auto address_at = [](const Server& server) { return address_of("rotctl://" + server.place(), "rotctl://", 1); };
  const double begin_s = seconds_now();
  LineSocket one(address_at(slow), 0.5), two(address_at(dribbling), 0.5);
  EXPECT_THAT(fault_of([&] { (void)http_post(one, "/", "<a/>", 0.5); }), HasSubstr("no answer within"));
  EXPECT_LT(seconds_now() - begin_s, 1.0);
  two.connect();
  EXPECT_THAT(fault_of([&] { (void)two.line(); }), HasSubstr("no answer within"));
  EXPECT_LT(seconds_now() - begin_s, 2.0);
}

TEST(HostileLinks, ErrorsOfHttpAreNamedThoughTheirPagesAreXml) {
  const auto fault_by = [](int status, const std::string& header) {
    const Server server = camera([&](const std::string&) { return http(status, page, header); });
    return fault_of([&] { (void)open_onvif("onvif://" + server.place(), {}); });
  };
  EXPECT_THAT(fault_by(401, "WWW-Authenticate: Digest realm=\"cam\"\r\n"),
              HasSubstr("refuses the user or the password (HTTP 401; it asks for HTTP's own Digest"));
  EXPECT_THAT(fault_by(401, ""), HasSubstr("refuses the user or the password (HTTP 401)"));
  EXPECT_THAT(fault_by(404, ""), HasSubstr("answers GetSystemDateAndTime with HTTP 404"));
  EXPECT_THAT(fault_by(200, ""), HasSubstr("and no SOAP"));
  const Server refuses =
      camera([](const std::string& request) { return turning_camera(request, "<PanTilt x='0' y='0'/>"); });
  const std::unique_ptr<HeadDevice> head = open_onvif("onvif://" + refuses.place(), {});
  EXPECT_THAT(fault_of([&] { (void)head->command({0.1, 0.1}); }), HasSubstr("answers AbsoluteMove with HTTP 500"));
}

TEST(HostileLinks, WhatIsNoNumberIsQuoted) {
  for (const std::string bad : {"0,1234", "", "0.1°", "nan", "1e999", "0x1"}) {
    const Server server =
        camera([&](const std::string& request) { return turning_camera(request, "<PanTilt x='" + bad + "' y='0'/>"); });
    const std::unique_ptr<HeadDevice> head = open_onvif("onvif://" + server.place(), {});
    EXPECT_THAT(fault_of([&] { (void)head->position(); }), HasSubstr("'" + bad + "' is no number: x of PanTilt"));
    const Server rotator([&](int socket, const std::atomic<bool>& ends) {
      std::string asked;
      while (!ends && heard(socket, asked)) {
        if (asked.find("state") != std::string::npos) say(socket, "done\n");
        if (asked.find("p\n") != std::string::npos) say(socket, bad + "\n0\n");
        asked.clear();
      }
    });
    const std::unique_ptr<HeadDevice> rotctl = open_rotctl("rotctl://" + rotator.place(), {});
    EXPECT_THAT(fault_of([&] { (void)rotctl->position(); }), HasSubstr("'" + bad + "' is no angle"));
  }
  const Server good =
      camera([](const std::string& request) { return turning_camera(request, "<PanTilt x=' 0.5' y='+0.25'/>"); });
  const Eigen::Vector2d at = open_onvif("onvif://" + good.place(), {})->position().pan_tilt_rad / degree;
  EXPECT_NEAR(at[0], -90.0, 1e-9);
  EXPECT_NEAR(at[1], 22.5, 1e-9);
}

TEST(HostileLinks, LimitsInDegreesAreAngles) {
  const std::string space = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalPositionSpaceDegrees";
  const std::string range =
      "<XRange><Min>-170</Min><Max>160</Max></XRange><YRange><Min>-10</Min><Max>80</Max></YRange>";
  const Server server = camera([&](const std::string& request) {
    return turning_camera(request, "<PanTilt x='30' y='20'/>",
                          "<DefaultAbsolutePantTiltPositionSpace>" + space +
                              "</DefaultAbsolutePantTiltPositionSpace><PanTiltLimits><Range><URI>" + space + "</URI>" +
                              range + "</Range></PanTiltLimits>");
  });
  const std::unique_ptr<HeadDevice> head = open_onvif("onvif://" + server.place(), {});
  const HeadLimits limits = head->limits();
  EXPECT_TRUE(limits.assumed.empty());
  EXPECT_TRUE((limits.low_rad / degree).isApprox(Eigen::Vector2d(-160.0, -10.0)));
  EXPECT_TRUE((limits.high_rad / degree).isApprox(Eigen::Vector2d(170.0, 80.0)));
  EXPECT_TRUE((head->position().pan_tilt_rad / degree).isApprox(Eigen::Vector2d(-30.0, 20.0)));
}

/// A mount that stands at that right ascension [°] and reports nothing else.
Server resting_mount(double right_ascension_deg) {
  return Server([=](int socket, const std::atomic<bool>& ends) {
    std::string said;
    while (!ends && heard(socket, said)) {
      if (said.find("getProperties") == std::string::npos) continue;
      said.clear();
      say(socket,
          "<defSwitchVector device='Mount' name='CONNECTION'><defSwitch name='CONNECT'>On</defSwitch></defSwitchVector>"
          "<defNumberVector device='Mount' name='EQUATORIAL_EOD_COORD' state='Ok'><defNumber name='RA'>" +
              std::to_string(right_ascension_deg / 15.0) +
              "</defNumber><defNumber name='DEC'>10</defNumber></defNumberVector>");
    }
  });
}

TEST(HostileLinks, ATurnMoreOrLessIsCountedAsTheRangeHasIt) {
  struct Case {
    double stands_deg, low_deg, high_deg, read_deg;
  };
  for (const Case& each : {Case{358.0, -20.0, 20.0, -2.0}, {3.0, 345.0, 365.0, 363.0}, {358.0, 340.0, 359.0, 358.0}}) {
    const Server mount = resting_mount(each.stands_deg);
    const std::unique_ptr<HeadDevice> head = open_indi("indi://" + mount.place() + "/Mount", {});
    MovingHead moving(*head, Eigen::Vector2d(each.low_deg, 0.0) * degree, Eigen::Vector2d(each.high_deg, 40.0) * degree,
                      {});
    EXPECT_NEAR(moving.position().pan_tilt_rad[0] / degree, each.read_deg, 1e-4);
    moving.command(Eigen::Vector2d(each.read_deg + 0.5, 12.0) * degree);
  }
  const Server mount = resting_mount(0.0);
  const std::unique_ptr<HeadDevice> head = open_indi("indi://" + mount.place() + "/Mount", {});
  MovingHead moving(*head, Eigen::Vector2d(30.0, 0.0) * degree, Eigen::Vector2d(60.0, 40.0) * degree, {});
  EXPECT_THAT(fault_of([&] { (void)moving.command(Eigen::Vector2d(33.0, 12.0) * degree); }),
              HasSubstr("stands at pan 0.000°, outside of 30…60°; nothing was moved"));
  const HeadSurvey survey = survey_head(*head, false);
  EXPECT_THAT(survey.verdict.sentence, HasSubstr("reports its position unasked"));
  EXPECT_THAT(survey.verdict.sentence, Not(HasSubstr("answers in")));
}

}  // namespace
}  // namespace alidade
