#include "alidade/live/protocol.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <nlohmann/json.hpp>

namespace alidade::live {
namespace {

using Json = nlohmann::ordered_json;

void append_little_endian(std::string& bytes, std::uint64_t value, int num_bytes) {
  for (int i = 0; i < num_bytes; ++i) bytes += static_cast<char>((value >> (8 * i)) & 0xffU);
}

std::string dumped(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

/// Name and port of "NAME:PORT", "[IPV6]:PORT" or either without its port.
std::pair<std::string, std::string> name_and_port(std::string_view host) {
  const std::size_t after = host.starts_with('[') ? host.find(']') : std::size_t{0};
  if (after == std::string_view::npos) return {};
  const std::size_t colon = host.find(':', after);
  std::string_view name = host.substr(0, colon);
  if (name.starts_with('[')) name = name.substr(1, name.size() - 2);
  return {lower(name), colon == std::string_view::npos ? "80" : std::string(host.substr(colon + 1))};
}

bool is_numeric(std::string_view name) {
  const bool is_v6 = name.find(':') != std::string_view::npos;
  return !name.empty() && std::ranges::all_of(name, [is_v6](char c) {
    return std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.' ||
           (is_v6 && (c == ':' || std::isxdigit(static_cast<unsigned char>(c)) != 0));
  });
}

template <class Id>
Id id_of(const Json& value) {
  const auto id = value.is_number_integer() ? value.get<std::int64_t>() : -1;  // what has a fraction may be of any size
  if (id < 0 || static_cast<std::uint64_t>(id) > std::numeric_limits<std::uint32_t>::max())
    throw std::out_of_range("an id is a whole number of 32 bits");
  return static_cast<Id>(id);
}

}  // namespace

std::string server_info_text(std::string_view name, std::string_view session_id) {
  return dumped({{"op", "serverInfo"},
                 {"name", name},
                 {"capabilities", Json::array({"time"})},
                 {"supportedEncodings", Json::array()},
                 {"metadata", Json::object()},
                 {"sessionId", session_id}});
}

std::string advertise_text(std::span<const Channel> channels) {
  Json list = Json::array();
  for (std::size_t i = 0; i < channels.size(); ++i)
    list.push_back({{"id", i + 1},
                    {"topic", channels[i].topic},
                    {"encoding", "json"},
                    {"schemaName", channels[i].schema_name},
                    {"schema", channels[i].schema},
                    {"schemaEncoding", "jsonschema"}});
  return dumped({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string status_text(StatusLevel level, std::string_view message) {
  return dumped({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string message_head(std::uint32_t subscription, std::uint64_t t_ns) {
  std::string bytes(1, '\x01');
  append_little_endian(bytes, subscription, 4);
  append_little_endian(bytes, t_ns, 8);
  return bytes;
}

std::string time_bytes(std::uint64_t t_ns) {
  std::string bytes(1, '\x02');
  append_little_endian(bytes, t_ns, 8);
  return bytes;
}

ClientRequest client_request(std::string_view text) {
  ClientRequest request;
  try {
    const Json json = Json::parse(text);
    const std::string op = json.at("op").get<std::string>();
    if (op == "subscribe") {
      for (const Json& one : json.at("subscriptions"))
        request.subscribe.emplace_back(id_of<std::uint32_t>(one.at("id")), id_of<std::uint64_t>(one.at("channelId")));
    } else if (op == "unsubscribe") {
      for (const Json& id : json.at("subscriptionIds")) request.unsubscribe.push_back(id_of<std::uint32_t>(id));
    } else {
      request.fault = "'" + op.substr(0, 40) + "' is not answered here: this server is read only";
    }
  } catch (const std::exception&) {
    request = {};
    request.fault = "a request that cannot be read; subscribe and unsubscribe are answered";
  }
  return request;
}

std::optional<std::string> chosen_subprotocol(std::string_view offered) {
  bool has_old = false;
  while (!offered.empty()) {
    const std::size_t comma = std::min(offered.find(','), offered.size());
    const std::string_view name = trimmed(offered.substr(0, comma));
    if (name == "foxglove.sdk.v1") return std::string(name);
    has_old = has_old || name == "foxglove.websocket.v1";
    offered.remove_prefix(std::min(comma + 1, offered.size()));
  }
  if (has_old) return "foxglove.websocket.v1";
  return std::nullopt;
}

bool is_own_host(std::string_view host, std::string_view address, std::uint16_t port, std::string_view machine_name) {
  const auto [name, port_text] = name_and_port(trimmed(host));
  if (port_text != std::to_string(port)) return false;
  const bool is_loopback = address.starts_with("127.") || address == "::1";
  const bool is_any = address == "0.0.0.0" || address == "::";
  if (name == address || name == "localhost") return true;
  if (is_loopback) return name == "127.0.0.1" || name == "::1";
  if (!machine_name.empty() && (name == lower(machine_name) || name == lower(machine_name) + ".local")) return true;
  return is_any && is_numeric(name);
}

std::string_view path_of(std::string_view target) { return target.substr(0, target.find('?')); }

bool has_token(std::string_view target, std::string_view token) {
  const std::size_t question = target.find('?');
  if (question == std::string_view::npos || token.empty()) return false;
  std::string_view query = target.substr(question + 1);
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    const std::string_view pair = query.substr(0, end);
    if (pair.starts_with("token=") && pair.size() == 6 + token.size()) {
      unsigned difference = 0;
      for (std::size_t i = 0; i < token.size(); ++i) difference |= static_cast<unsigned>(pair[6 + i] ^ token[i]);
      return difference == 0;
    }
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return false;
}

}  // namespace alidade::live
