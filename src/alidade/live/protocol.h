#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// The Foxglove WebSocket protocol as text and bytes, without a socket. Foxglove, ws-protocol/docs/spec.md.

namespace alidade::live {

/// What clients may subscribe to. Its id is its place in the list, from 1.
struct Channel {
  std::string topic;        ///< "/track"
  std::string schema_name;  ///< "foxglove.SceneUpdate"
  std::string schema;       ///< JSON Schema, as text.
};

enum class StatusLevel { info = 0, warning = 1, error = 2 };

[[nodiscard]] std::string server_info_text(std::string_view name, std::string_view session_id);
[[nodiscard]] std::string advertise_text(std::span<const Channel> channels);
[[nodiscard]] std::string status_text(StatusLevel level, std::string_view message);

/// Binary messages, little-endian. What stands before a payload: u8 1 | u32 subscription | u64 ns; the whole of a
/// time: u8 2 | u64 ns.
[[nodiscard]] std::string message_head(std::uint32_t subscription, std::uint64_t t_ns);
[[nodiscard]] std::string time_bytes(std::uint64_t t_ns);

/// What a client asked for.
struct ClientRequest {
  std::vector<std::pair<std::uint32_t, std::uint64_t>> subscribe;  ///< Subscription, channel.
  std::vector<std::uint32_t> unsubscribe;                          ///< Subscriptions.
  std::string fault;                                               ///< Not empty: what is wrong with the request.
};
[[nodiscard]] ClientRequest client_request(std::string_view text);

/// Of the names in Sec-WebSocket-Protocol: foxglove.sdk.v1, else foxglove.websocket.v1, else none. One protocol has two
/// names, and clients know one of them.
[[nodiscard]] std::optional<std::string> chosen_subprotocol(std::string_view offered);

/// Whether a Host header means this server, so that no page of another name reaches it by a name that its owner points
/// here (DNS rebinding). `address`: what the server listens on; "0.0.0.0" and "::" answer to any numeric address.
[[nodiscard]] bool is_own_host(std::string_view host, std::string_view address, std::uint16_t port,
                               std::string_view machine_name = {});

/// Path of a request target, "/result.json" of "/result.json?token=…".
[[nodiscard]] std::string_view path_of(std::string_view target);
/// Whether the target's query has `token=TOKEN`. In a time that does not reveal how much of it was right.
[[nodiscard]] bool has_token(std::string_view target, std::string_view token);

}  // namespace alidade::live
