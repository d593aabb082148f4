#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "alidade/heads/protocols/line_socket.h"

// What ONVIF's client and server both need: SOAP 1.2 over HTTP, and the digest by which a user is known.

namespace alidade {

/// OASIS WS-Security UsernameToken Profile 1.1: what stands for a password in a message, good for a few minutes.
struct UsernameToken {
  std::string user, nonce, created, digest;  ///< `nonce` and `digest` in base64, `created` as 2026-01-31T12:00:00Z.
};
/// Base64(SHA-1(nonce + created + password)). `nonce`: its bytes.
[[nodiscard]] std::string password_digest(std::string_view nonce, std::string_view created, std::string_view password);
/// With a nonce that was not used before.
[[nodiscard]] UsernameToken username_token(const std::string& user, const std::string& password, double unix_s);

[[nodiscard]] std::string base64_text(std::string_view bytes);
/// Characters that are none of base64 are skipped.
[[nodiscard]] std::string base64_bytes(std::string_view text);
/// 2026-01-31T12:00:00Z of seconds since 1970, and back, with or without fractions and Z; NaN of what is no such time.
[[nodiscard]] std::string utc_text(double unix_s);
[[nodiscard]] double utc_seconds(const std::string& text);

/// A whole message; `body`: one element. On one line, in the words that most clients write.
[[nodiscard]] std::string soap_request(const UsernameToken& token, std::string_view body);
[[nodiscard]] std::string escaped_xml(std::string_view text);

struct HttpReply {
  int status = 0;
  bool asks_for_digest = false;  ///< By HTTP's own authentication (WWW-Authenticate: Digest).
  std::string body;
};
/// Asks and reads the answer, whether it says its length, comes in chunks or ends with the connection; the socket is
/// closed then. Throws InputError: no whole answer within so many seconds, no HTTP, an answer without end.
[[nodiscard]] HttpReply http_post(LineSocket& socket, const std::string& path, std::string_view body, double max_s);

}  // namespace alidade
