#include "alidade/heads/protocols/onvif_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/heads/protocols/soap.h"

#if __has_include(<pugixml.hpp>)
#include <pugixml.hpp>
#endif

namespace alidade {

std::optional<TlsTrust> onvif_trust(const std::string& url) {
  constexpr std::size_t sha256_digits = 64;
  TlsTrust trust{address_of(url, "onvif://", 80).host, ""};
  bool is_asked = false;
  for (std::size_t at = url.find_first_of("?&"); at != std::string::npos; at = url.find_first_of("?&", at + 1)) {
    const std::string part = url.substr(at + 1, url.find_first_of("?&", at + 1) - at - 1);
    if (part == "https=1") is_asked = true;
    if (!part.starts_with("cert=")) continue;
    is_asked = true;
    for (const char letter : part.substr(5))
      if (letter != ':')
        trust.fingerprint.push_back(static_cast<char>(std::tolower(static_cast<unsigned char>(letter))));
    if (trust.fingerprint.size() != sha256_digits ||
        trust.fingerprint.find_first_not_of("0123456789abcdef") != std::string::npos)
      throw InputError("onvif://…: cert= is the SHA-256 of a certificate, 64 hexadecimal digits");
  }
  return is_asked ? std::optional(trust) : std::nullopt;
}

#if __has_include(<pugixml.hpp>)
namespace {

std::string_view local_name(const pugi::xml_node& node) {
  const std::string_view name = node.name();
  const std::size_t colon = name.find(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

/// The first element of that name below, whatever its prefix; a null node where there is none.
pugi::xml_node first_named(const pugi::xml_node& node, std::string_view name) {
  return node.find_node([&](const pugi::xml_node& each) { return local_name(each) == name; });
}

std::string text_in(const pugi::xml_node& node, std::string_view name) { return first_named(node, name).child_value(); }

/// Of 'http://HOST:PORT/PATH' or '/PATH'.
std::string path_of(const std::string& address) {
  const std::size_t scheme = address.find("://");
  const std::size_t slash = address.find('/', scheme == std::string::npos ? 0 : scheme + 3);
  return slash == std::string::npos ? "/" : address.substr(slash);
}

/// The whole of a text that a camera sent as a number. Throws InputError that quotes anything else.
double number_of(const std::string& where, const std::string& text, const std::string& what) {
  if (const auto number = finite_number(text)) return *number;
  throw InputError(fmt::format("{}: '{}' is no number: {}", where, text.substr(0, 40), what));
}

/// None where there is no such attribute.
std::optional<double> attribute_of(const std::string& where, const pugi::xml_node& node, const char* attribute) {
  if (!node.attribute(attribute)) return std::nullopt;
  return number_of(where, node.attribute(attribute).value(),
                   fmt::format("{} of {} in its position", attribute, local_name(node)));
}

void read_range(const std::string& where, const pugi::xml_node& node, OnvifRange& range) {
  if (!first_named(node, "Min") || !first_named(node, "Max")) return;
  const double low = number_of(where, text_in(node, "Min"), "Min of its range"),
               high = number_of(where, text_in(node, "Max"), "Max of its range");
  if (low < high) range = {low, high};
}

constexpr const char* device_ns = "http://www.onvif.org/ver10/device/wsdl";
constexpr const char* media_ns = "http://www.onvif.org/ver10/media/wsdl";
constexpr const char* ptz_ns = "http://www.onvif.org/ver20/ptz/wsdl";
constexpr const char* schema_ns = "http://www.onvif.org/ver10/schema";

}  // namespace

struct OnvifService::State {
  State(const std::string& url, const HeadOptions& options)
      : password(options.password),
        max_s(options.timeout_s),
        socket(address_of(url, "onvif://", onvif_trust(url) ? 443 : 80), std::max(options.timeout_s, patience_s)) {
    if (auto trust = onvif_trust(url)) socket.encrypt(std::move(*trust));
  }

  static constexpr double patience_s = 1.0;  // a camera computes a digest, and opens a connection for each question
  std::string password;
  double max_s;
  LineSocket socket;
  double behind_s = 0.0;  ///< The camera's clock, of ours: its digests are good for a few minutes of its own time.
  std::string device_path = "/onvif/device_service", media_path = device_path, ptz_path = device_path;

  pugi::xml_document ask(const std::string& path, const std::string& command, const char* space,
                         const std::string& inside = "", bool names_user = true) {
    const SocketAddress& address = socket.address();
    UsernameToken token;
    if (names_user) token = username_token(address.user, password, machine_clock()->now_s() + behind_s);
    const std::string body = fmt::format("<{0} xmlns=\"{1}\">{2}</{0}>", command, space, inside);
    const HttpReply reply = http_post(socket, path, soap_request(token, body), std::max(max_s, patience_s));
    pugi::xml_document document;
    const bool is_soap =
        document.load_buffer(reply.body.data(), reply.body.size()) && first_named(document, "Envelope");
    if (const pugi::xml_node fault = first_named(document, "Fault"); is_soap && fault) refuse(fault, command);
    if (!is_soap || reply.status < 200 || reply.status > 299) refuse(reply, command);
    return document;
  }

  [[noreturn]] void refuse(const HttpReply& reply, const std::string& command) const {
    std::string why = fmt::format("answers {} with HTTP {}", command, reply.status);
    if (reply.status == 401)
      why = std::string("refuses the user or the password (HTTP 401") +
            (reply.asks_for_digest ? "; it asks for HTTP's own Digest, which is not supported)" : ")");
    else if (reply.status == 200)
      why += ", and no SOAP";
    throw InputError(socket.address().name + ": " + why);
  }

  [[noreturn]] void refuse(const pugi::xml_node& fault, const std::string& command) const {
    std::string code, why = text_in(fault, "Text");
    for (pugi::xml_node each = first_named(fault, "Subcode"); each; each = first_named(each, "Subcode"))
      code = text_in(each, "Value");
    if (why.empty()) why = text_in(fault, "faultstring");
    std::ranges::replace_if(
        why, [](unsigned char c) { return c < 0x20; }, ' ');
    if (code.find("NotAuthorized") != std::string::npos)
      why = socket.address().user.empty() ? "asks for a user: onvif://USER@HOST, the password in ALIDADE_PASSWORD"
                                          : "refuses the user or the password";
    throw InputError(fmt::format("{}: {}: {}", socket.address().name, command, why.substr(0, 120)));
  }
};

OnvifService::OnvifService(const std::string& url, const HeadOptions& options)
    : state_(std::make_unique<State>(url, options)) {
  State& state = *state_;
  const pugi::xml_document time = state.ask(state.device_path, "GetSystemDateAndTime", device_ns, "", false);
  const pugi::xml_node utc = first_named(time, "UTCDateTime");
  const std::string text =
      fmt::format("{:0>4}-{:0>2}-{:0>2}T{:0>2}:{:0>2}:{:0>2}", text_in(utc, "Year"), text_in(utc, "Month"),
                  text_in(utc, "Day"), text_in(utc, "Hour"), text_in(utc, "Minute"), text_in(utc, "Second"));
  const double camera_s = utc_seconds(text);
  if (utc && std::isfinite(camera_s)) state.behind_s = camera_s - machine_clock()->now_s();
  const pugi::xml_document able =
      state.ask(state.device_path, "GetCapabilities", device_ns, "<Category>All</Category>");
  const std::string media = text_in(first_named(able, "Media"), "XAddr"),
                    ptz = text_in(first_named(able, "PTZ"), "XAddr");
  if (!media.empty()) state.media_path = path_of(media);
  if (ptz.empty()) throw InputError(name() + ": the camera has no PTZ service: it does not turn");
  state.ptz_path = path_of(ptz);
}

OnvifService::~OnvifService() = default;
const std::string& OnvifService::name() const { return state_->socket.address().name; }

std::string OnvifService::maker() {
  const pugi::xml_document info = state_->ask(state_->device_path, "GetDeviceInformation", device_ns);
  return (text_in(info, "Manufacturer") + " " + text_in(info, "Model")).substr(0, 100);
}

std::vector<OnvifProfile> OnvifService::profiles() {
  const pugi::xml_document answer = state_->ask(state_->media_path, "GetProfiles", media_ns);
  std::vector<OnvifProfile> found;
  for (const pugi::xml_node& each : first_named(answer, "GetProfilesResponse").children()) {
    if (local_name(each) != "Profiles") continue;
    OnvifProfile profile{each.attribute("token").value(), text_in(each, "Name"), "", {}, {}};
    const pugi::xml_node ptz = first_named(each, "PTZConfiguration");
    profile.ptz_token = ptz.attribute("token").value();
    profile.has_pan_tilt = static_cast<bool>(ptz);
    profile.has_zoom = static_cast<bool>(first_named(ptz, "ZoomLimits"));
    const pugi::xml_node limits = first_named(ptz, "PanTiltLimits");
    if (limits) {
      const std::string space = text_in(limits, "URI");
      const std::string usual = text_in(ptz, "DefaultAbsolutePantTiltPositionSpace");  // so ONVIF writes it
      const auto is_degrees = [](const std::string& uri) { return uri.ends_with("SphericalPositionSpaceDegrees"); };
      profile.counts_degrees = is_degrees(space) && (usual.empty() || is_degrees(usual));
      if (is_degrees(space) == profile.counts_degrees) {  // else the limits are of another space than the positions
        read_range(name(), first_named(limits, "XRange"), profile.x);
        read_range(name(), first_named(limits, "YRange"), profile.y);
      }
    }
    found.push_back(std::move(profile));
  }
  return found;
}

OnvifStatus OnvifService::status(const OnvifProfile& profile) {
  const pugi::xml_document answer =
      state_->ask(state_->ptz_path, "GetStatus", ptz_ns,
                  fmt::format("<ProfileToken>{}</ProfileToken>", escaped_xml(profile.token)));
  const pugi::xml_node position = first_named(answer, "Position");
  OnvifStatus status;
  const pugi::xml_node pan_tilt = first_named(position, "PanTilt"), zoom = first_named(position, "Zoom");
  const auto x = attribute_of(name(), pan_tilt, "x"), y = attribute_of(name(), pan_tilt, "y"),
             zoom_x = attribute_of(name(), zoom, "x");
  status.has_pan_tilt = x && y;
  status.x = x.value_or(0.0);
  status.y = y.value_or(0.0);
  status.has_zoom = zoom_x.has_value();
  status.zoom = zoom_x.value_or(0.0);
  return status;
}

void OnvifService::move_to(const OnvifProfile& profile, double x, double y) {
  (void)state_->ask(
      state_->ptz_path, "AbsoluteMove", ptz_ns,
      fmt::format("<ProfileToken>{}</ProfileToken><Position><PanTilt x=\"{:.6f}\" y=\"{:.6f}\" xmlns=\"{}\"/>"
                  "</Position>",
                  escaped_xml(profile.token), x, y, schema_ns));
}

void OnvifService::zoom_to(const OnvifProfile& profile, double share) {
  (void)state_->ask(state_->ptz_path, "AbsoluteMove", ptz_ns,
                    fmt::format("<ProfileToken>{}</ProfileToken><Position><Zoom x=\"{:.6f}\" xmlns=\"{}\"/></Position>",
                                escaped_xml(profile.token), share, schema_ns));
}

void OnvifService::stop(const OnvifProfile& profile) {
  (void)state_->ask(state_->ptz_path, "Stop", ptz_ns,
                    fmt::format("<ProfileToken>{}</ProfileToken><PanTilt>true</PanTilt><Zoom>true</Zoom>",
                                escaped_xml(profile.token)));
}

std::string OnvifService::stream_uri(const OnvifProfile& profile) {
  const pugi::xml_document answer = state_->ask(
      state_->media_path, "GetStreamUri", media_ns,
      fmt::format("<StreamSetup><Stream xmlns=\"{0}\">RTP-Unicast</Stream><Transport xmlns=\"{0}\"><Protocol>RTSP"
                  "</Protocol></Transport></StreamSetup><ProfileToken>{1}</ProfileToken>",
                  schema_ns, escaped_xml(profile.token)));
  const std::string uri = text_in(answer, "Uri");
  const std::size_t scheme = uri.find("://");
  if (scheme == std::string::npos) throw InputError(name() + ": names no video stream");
  std::size_t end = uri.find('/', scheme + 3);
  end = std::min(end, uri.size());
  const std::size_t colon = uri.rfind(':', end - 1);
  const std::string port = colon > scheme && colon < end ? uri.substr(colon, end - colon) : "";
  const SocketAddress& address = state_->socket.address();
  const std::string user = address.user.empty() ? "" : address.user + "@";
  return uri.substr(0, scheme + 3) + user + address.host + port + uri.substr(end);
}

#else
struct OnvifService::State {};
OnvifService::OnvifService(const std::string& url, const HeadOptions&) {
  (void)address_of(url, "onvif://", 80);
  throw InputError("onvif://…: this alidade was built without libpugixml, which reads what such cameras say");
}
OnvifService::~OnvifService() = default;
const std::string& OnvifService::name() const { throw InputError("onvif://"); }
std::string OnvifService::maker() { return {}; }
std::vector<OnvifProfile> OnvifService::profiles() { return {}; }
OnvifStatus OnvifService::status(const OnvifProfile&) { return {}; }
void OnvifService::move_to(const OnvifProfile&, double, double) {}
void OnvifService::zoom_to(const OnvifProfile&, double) {}
void OnvifService::stop(const OnvifProfile&) {}
std::string OnvifService::stream_uri(const OnvifProfile&) { return {}; }
#endif

}  // namespace alidade
