#include "alidade/heads/protocols/onvif_protocol.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <optional>

#include "alidade/heads/protocols/soap.h"

#if __has_include(<pugixml.hpp>)
#include <pugixml.hpp>
#endif

namespace alidade {

#if __has_include(<pugixml.hpp>)
namespace {

std::string_view bare_name(const pugi::xml_node& node) {
  const std::string_view name = node.name();
  const std::size_t colon = name.find(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}
pugi::xml_node named(const pugi::xml_node& node, std::string_view name) {
  return node.find_node([&](const pugi::xml_node& each) { return bare_name(each) == name; });
}

/// What is answered instead: SOAP's fault.
struct OnvifFault {
  std::string code, text;
};

constexpr const char* spaces =
    "xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\" xmlns:ter=\"http://www.onvif.org/ver10/error\" "
    "xmlns:tds=\"http://www.onvif.org/ver10/device/wsdl\" xmlns:trt=\"http://www.onvif.org/ver10/media/wsdl\" "
    "xmlns:tptz=\"http://www.onvif.org/ver20/ptz/wsdl\" xmlns:tt=\"http://www.onvif.org/ver10/schema\"";
constexpr const char* pan_tilt_spaces = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/";
constexpr const char* zoom_spaces = "http://www.onvif.org/ver10/tptz/ZoomSpaces/";

std::string prefix_of(const std::string& command) {
  for (const char* media : {"GetProfiles", "GetVideoSources", "GetStreamUri", "GetSnapshotUri"})
    if (command == media) return "trt";
  for (const char* ptz : {"GetNodes", "GetConfigurations", "GetPresets", "GetStatus", "AbsoluteMove", "RelativeMove",
                          "ContinuousMove", "Stop"})
    if (command == ptz) return "tptz";
  return "tds";
}

std::string range_xml(const char* axis) {
  return fmt::format("<tt:{0}Range><tt:Min>-1</tt:Min><tt:Max>1</tt:Max></tt:{0}Range>", axis);
}

std::string space_xml(const char* tag, const std::string& uri, bool is_zoom) {
  return fmt::format(
      "<tt:{0}><tt:URI>{1}</tt:URI>{2}</tt:{0}>", tag, uri,
      is_zoom ? "<tt:XRange><tt:Min>0</tt:Min><tt:Max>1</tt:Max></tt:XRange>" : range_xml("X") + range_xml("Y"));
}

std::string ptz_configuration(const std::string& tag, bool has_zoom) {
  const std::string position = std::string(pan_tilt_spaces) + "PositionGenericSpace";
  std::string text = fmt::format(
      "<{} token=\"ptz0\"><tt:Name>ptz</tt:Name><tt:UseCount>1</tt:UseCount><tt:NodeToken>node0</tt:NodeToken>"
      "<tt:DefaultAbsolutePantTiltPositionSpace>{}</tt:DefaultAbsolutePantTiltPositionSpace>"
      "<tt:DefaultContinuousPanTiltVelocitySpace>{}VelocityGenericSpace</tt:DefaultContinuousPanTiltVelocitySpace>"
      "<tt:DefaultPTZTimeout>PT10S</tt:DefaultPTZTimeout><tt:PanTiltLimits>{}</tt:PanTiltLimits>",
      tag, position, pan_tilt_spaces, space_xml("Range", position, false));
  if (has_zoom)
    text += "<tt:ZoomLimits>" + space_xml("Range", std::string(zoom_spaces) + "PositionGenericSpace", true) +
            "</tt:ZoomLimits>";
  return text + "</" + tag + ">";
}

/// Seconds of PT1.5S.
double duration_of(const std::string& text) {
  constexpr double usual_s = 10.0, max_s = 60.0;
  if (!text.starts_with("PT")) return usual_s;
  const double value = std::strtod(text.c_str() + 2, nullptr);
  return std::isfinite(value) && value > 0.0 ? std::min(value, max_s) : usual_s;
}

}  // namespace

struct OnvifCamera::Call {
  std::string command;
  pugi::xml_node header, body;
};

Eigen::Vector2d OnvifCamera::counts(const Eigen::Vector2d& at) const {
  const SimulatedHeadConfig& head = plant_.config();
  const Eigen::Vector2d share = (at - head.low_rad).cwiseQuotient(head.high_rad - head.low_rad);
  return {1.0 - 2.0 * share[0], 2.0 * share[1] - 1.0};
}
Eigen::Vector2d OnvifCamera::angles(const Eigen::Vector2d& xy) const {
  const SimulatedHeadConfig& head = plant_.config();
  const Eigen::Vector2d share(0.5 * (1.0 - xy[0]), 0.5 * (1.0 + xy[1]));
  return head.low_rad + share.cwiseProduct(head.high_rad - head.low_rad);
}

void OnvifCamera::check_user(const Call& call, double t_s) {
  constexpr double window_s = 300.0;
  if (config_.user.empty() || call.command == "GetSystemDateAndTime") return;
  const pugi::xml_node token = named(call.header, "UsernameToken");
  const std::string user = named(token, "Username").child_value(), digest = named(token, "Password").child_value();
  const std::string nonce = named(token, "Nonce").child_value(), created = named(token, "Created").child_value();
  const double age_s = std::abs(utc_seconds(created) - t_s);
  bool is_known = user == config_.user && !nonce.empty() && age_s < window_s &&
                  digest == password_digest(base64_bytes(nonce), created, config_.password);
  const std::scoped_lock lock(mutex_);
  constexpr std::size_t max_nonces = 100000;
  if (is_known && nonces_.size() < max_nonces) is_known = nonces_.insert(nonce + created).second;
  if (!is_known) throw OnvifFault{"ter:NotAuthorized", "Sender not Authorized"};
}

std::string OnvifCamera::profile() const {
  return fmt::format(
      "<trt:Profiles token=\"main\" fixed=\"true\"><tt:Name>main</tt:Name><tt:VideoSourceConfiguration token=\"vs0\">"
      "<tt:Name>vs</tt:Name><tt:UseCount>1</tt:UseCount><tt:SourceToken>src0</tt:SourceToken><tt:Bounds x=\"0\" "
      "y=\"0\" "
      "width=\"{0}\" height=\"{1}\"/></tt:VideoSourceConfiguration><tt:VideoEncoderConfiguration token=\"ve0\">"
      "<tt:Name>ve</tt:Name><tt:UseCount>1</tt:UseCount><tt:Encoding>JPEG</tt:Encoding><tt:Resolution><tt:Width>{0}"
      "</tt:Width><tt:Height>{1}</tt:Height></tt:Resolution><tt:Quality>5</"
      "tt:Quality><tt:RateControl><tt:FrameRateLimit>12</tt:FrameRateLimit>"
      "<tt:EncodingInterval>1</tt:EncodingInterval><tt:BitrateLimit>4096</tt:BitrateLimit></tt:RateControl></"
      "tt:VideoEncoderConfiguration>{2}"
      "</trt:Profiles>",
      config_.width_px, config_.height_px, ptz_configuration("tt:PTZConfiguration", plant_.config().has_zoom));
}

std::string OnvifCamera::status(double t_s) {
  const Eigen::Vector2d at = counts(plant_.reading(t_s));
  constexpr double no_minus_zero = 0.0;
  return fmt::format(
      "<tptz:PTZStatus><tt:Position><tt:PanTilt x=\"{:.6f}\" y=\"{:.6f}\" space=\"{}PositionGenericSpace\"/><tt:Zoom "
      "x=\"{:.4f}\"/></tt:Position><tt:MoveStatus><tt:PanTilt>{}</tt:PanTilt><tt:Zoom>IDLE</tt:Zoom></tt:MoveStatus>"
      "<tt:UtcTime>{}</tt:UtcTime></tptz:PTZStatus>",
      no_minus_zero + at[0], no_minus_zero + at[1], pan_tilt_spaces, plant_.zoom(),
      plant_.is_at_rest(t_s) ? "IDLE" : "MOVING", utc_text(t_s));
}

void OnvifCamera::move(const Call& call, double t_s) {
  const pugi::xml_node pan_tilt = named(call.body, "PanTilt"), zoom = named(call.body, "Zoom");
  const auto number = [](const pugi::xml_node& node, const char* name) {
    const char* text = node.attribute(name).value();
    char* end = nullptr;
    const double value = std::strtod(text, &end);
    if (*text == '\0' || *end != '\0' || !std::isfinite(value) || std::abs(value) > 1e6)
      throw OnvifFault{"ter:InvalidPosition", "not a finite number"};
    return value;
  };
  if (call.command == "AbsoluteMove" && zoom && plant_.config().has_zoom) {
    const double share = number(zoom, "x");
    if (share < 0.0 || share > 1.0) throw OnvifFault{"ter:InvalidPosition", "outside of the range"};
    plant_.zoom_to(t_s, share);
  }
  if (!pan_tilt) return;
  Eigen::Vector2d xy(number(pan_tilt, "x"), number(pan_tilt, "y"));
  if (call.command == "ContinuousMove") {
    const double last_s = duration_of(named(call.body, "Timeout").child_value());
    plant_.turn(t_s, Eigen::Vector2d(-xy[0], xy[1]), t_s + last_s);
    return;
  }
  if (call.command == "RelativeMove") xy = (xy + counts(plant_.reading(t_s))).cwiseMax(-1.0).cwiseMin(1.0);
  if (xy.cwiseAbs().maxCoeff() > 1.0) throw OnvifFault{"ter:InvalidPosition", "outside of the range"};
  plant_.go_to(t_s, angles(xy));
}

std::string OnvifCamera::what_it_is(const std::string& command, double t_s) const {
  const std::string here = fmt::format("http://{}:{}/onvif", config_.address, config_.port);
  if (command == "GetSystemDateAndTime") {
    const std::string now = utc_text(t_s);
    const auto part = [&now](std::size_t from, std::size_t count) {
      return std::atoi(now.substr(from, count).c_str());
    };
    return fmt::format(
        "<tds:SystemDateAndTime><tt:DateTimeType>NTP</tt:DateTimeType><tt:DaylightSavings>false</tt:DaylightSavings>"
        "<tt:UTCDateTime><tt:Time><tt:Hour>{}</tt:Hour><tt:Minute>{}</tt:Minute><tt:Second>{}</tt:Second></tt:Time>"
        "<tt:Date><tt:Year>{}</tt:Year><tt:Month>{}</tt:Month><tt:Day>{}</tt:Day></tt:Date></tt:UTCDateTime>"
        "</tds:SystemDateAndTime>",
        part(11, 2), part(14, 2), part(17, 2), part(0, 4), part(5, 2), part(8, 2));
  }
  if (command == "GetDeviceInformation")
    return "<tds:Manufacturer>alidade</tds:Manufacturer><tds:Model>simulate head</tds:Model><tds:FirmwareVersion>1"
           "</tds:FirmwareVersion><tds:SerialNumber>1</tds:SerialNumber><tds:HardwareId>none</tds:HardwareId>";
  if (command == "GetCapabilities")
    return fmt::format(
        "<tds:Capabilities><tt:Device><tt:XAddr>{0}/device_service</tt:XAddr></tt:Device><tt:Media><tt:XAddr>{0}/media"
        "</tt:XAddr><tt:StreamingCapabilities><tt:RTPMulticast>false</tt:RTPMulticast></tt:StreamingCapabilities>"
        "</tt:Media><tt:PTZ><tt:XAddr>{0}/ptz</tt:XAddr></tt:PTZ></tds:Capabilities>",
        here);
  if (command == "GetServices") {
    std::string text;
    for (const auto& [space, path] :
         {std::pair{"ver10/device/wsdl", "device_service"}, {"ver10/media/wsdl", "media"}, {"ver20/ptz/wsdl", "ptz"}})
      text += fmt::format(
          "<tds:Service><tds:Namespace>http://www.onvif.org/{}</tds:Namespace><tds:XAddr>{}/{}</tds:XAddr>"
          "<tds:Version><tt:Major>2</tt:Major><tt:Minor>0</tt:Minor></tds:Version></tds:Service>",
          space, here, path);
    return text;
  }
  return media_or_ptz(command);
}

std::string OnvifCamera::media_or_ptz(const std::string& command) const {
  const auto uri = [](const std::string& text) {
    return fmt::format(
        "<trt:MediaUri><tt:Uri>{}</tt:Uri><tt:InvalidAfterConnect>false</tt:InvalidAfterConnect><tt:InvalidAfterReboot>"
        "false</tt:InvalidAfterReboot><tt:Timeout>PT0S</tt:Timeout></trt:MediaUri>",
        escaped_xml(text));
  };
  if (command == "GetScopes")
    return "<tds:Scopes><tt:ScopeDef>Fixed</tt:ScopeDef><tt:ScopeItem>onvif://www.onvif.org/type/ptz</tt:ScopeItem>"
           "</tds:Scopes>";
  if (command == "GetStreamUri" || command == "GetSnapshotUri") return uri(config_.stream_url);
  if (command == "GetVideoSources")
    return fmt::format(
        "<trt:VideoSources token=\"src0\"><tt:Framerate>12</tt:Framerate><tt:Resolution><tt:Width>{}"
        "</tt:Width><tt:Height>{}</tt:Height></tt:Resolution></trt:VideoSources>",
        config_.width_px, config_.height_px);
  if (command == "GetNodes") {
    const std::string space = pan_tilt_spaces;
    return "<tptz:PTZNode token=\"node0\" FixedHomePosition=\"true\"><tt:Name>head</tt:Name><tt:SupportedPTZSpaces>" +
           space_xml("AbsolutePanTiltPositionSpace", space + "PositionGenericSpace", false) +
           space_xml("RelativePanTiltTranslationSpace", space + "TranslationGenericSpace", false) +
           space_xml("ContinuousPanTiltVelocitySpace", space + "VelocityGenericSpace", false) +
           "</tt:SupportedPTZSpaces><tt:MaximumNumberOfPresets>0</tt:MaximumNumberOfPresets><tt:HomeSupported>false"
           "</tt:HomeSupported></tptz:PTZNode>";
  }
  if (command == "GetConfigurations") return ptz_configuration("tptz:PTZConfiguration", plant_.config().has_zoom);
  if (command == "GetPresets") return "";
  throw OnvifFault{"ter:ActionNotSupported", command.substr(0, 60) + " is not known here"};
}

std::string OnvifCamera::inside_of(const Call& call, double t_s) {
  const std::string& command = call.command;
  if (command == "GetProfiles") return profile();
  if (command == "GetStatus") return status(t_s);
  if (command == "Stop") {
    plant_.stop(t_s);
    return "";
  }
  if (command == "AbsoluteMove" || command == "RelativeMove" || command == "ContinuousMove") {
    move(call, t_s);
    return "";
  }
  return what_it_is(command, t_s);
}

OnvifCamera::Answer OnvifCamera::answer(const std::string& message, double t_s) {
  plant_.hear(t_s);
  Answer answer;
  pugi::xml_document document;
  std::string inside;
  try {
    const bool is_xml = static_cast<bool>(document.load_buffer(message.data(), message.size()));
    const pugi::xml_node body = named(document, "Body"), command = body.find_child([](const pugi::xml_node&each) {
      return each.type() == pugi::node_element;
    });
    if (!is_xml || !command) throw OnvifFault{"ter:WellFormed", "not understood"};
    const Call call{std::string(bare_name(command)), named(document, "Header"), command};
    check_user(call, t_s);
    const std::string name = prefix_of(call.command) + ":" + call.command + "Response";
    inside = inside_of(call, t_s);
    inside = fmt::format("<{0}>{1}</{0}>", name, inside);
  } catch (const OnvifFault& fault) {
    answer.status = 400;
    inside = fmt::format(
        "<s:Fault><s:Code><s:Value>s:Sender</s:Value><s:Subcode><s:Value>{}</s:Value></s:Subcode></s:Code><s:Reason>"
        "<s:Text xml:lang=\"en\">{}</s:Text></s:Reason></s:Fault>",
        fault.code, escaped_xml(fault.text));
  }
  answer.body = fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?><s:Envelope {}><s:Body>{}</s:Body></s:Envelope>",
                            spaces, inside);
  return answer;
}

#else
struct OnvifCamera::Call {};
OnvifCamera::Answer OnvifCamera::answer(const std::string&, double) { return {501, "built without libpugixml"}; }
#endif

}  // namespace alidade
