#include "alidade/heads/protocols/soap.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/uuid/detail/sha1.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <optional>
#include <random>

#include "alidade/files/files.h"

namespace alidade {
namespace {

constexpr std::string_view base64_letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

std::string sha1_bytes(const std::string& text) {
  boost::uuids::detail::sha1 hash;
  hash.process_bytes(text.data(), text.size());
  unsigned int words[5];
  hash.get_digest(words);
  std::string bytes;
  for (const unsigned int word : words)
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>(word >> shift));
  return bytes;
}

bool begins_with_word(const std::string& line, std::string_view word) {
  return line.size() >= word.size() && std::equal(word.begin(), word.end(), line.begin(), [](char a, char b) {
           return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
         });
}

constexpr std::size_t max_bytes = 1 << 24;  // of an answer

/// All of the text, of HTTP's header.
std::size_t whole_size(const LineSocket& socket, std::string_view text, int base) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  std::size_t size = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), size, base);
  if (error == std::errc{} && end == text.data() + text.size() && size <= max_bytes) return size;
  throw InputError(fmt::format("{}: sends '{}' bytes", socket.address().name, text.substr(0, 40)));
}

std::string chunked_body(LineSocket& socket) {
  std::string body;
  for (;;) {
    const std::string line = socket.line();
    const std::size_t size = whole_size(socket, line.substr(0, line.find(';')), 16);
    if (size == 0) return body;
    if (body.size() + size > max_bytes) throw InputError(socket.address().name + ": sends what has no end");
    body += socket.bytes(size);
    (void)socket.line();
  }
}

}  // namespace

std::string base64_text(std::string_view bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text.push_back(i + k <= bytes.size() ? base64_letters[three >> (18 - 6 * k) & 63u] : '=');
  }
  return text;
}

std::string base64_bytes(std::string_view text) {
  std::string bytes;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char letter : text) {
    const std::size_t value = base64_letters.find(letter);
    if (value == std::string_view::npos) continue;
    held = held << 6 | static_cast<std::uint32_t>(value);
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(static_cast<char>(held >> bits));
  }
  return bytes;
}

std::string utc_text(double unix_s) {
  const auto whole = static_cast<std::time_t>(std::floor(unix_s));
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}Z", fmt::gmtime(whole));
}

double utc_seconds(const std::string& text) {
  int year = 0, hour = 0, minute = 0;
  unsigned month = 0, day = 0;
  double second = 0.0;
  if (std::sscanf(text.c_str(), "%4d-%2u-%2uT%2d:%2d:%lf", &year, &month, &day, &hour, &minute, &second) != 6)
    return std::numeric_limits<double>::quiet_NaN();
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  if (!date.ok()) return std::numeric_limits<double>::quiet_NaN();
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600.0 * hour + 60.0 * minute + second;
}

std::string password_digest(std::string_view nonce, std::string_view created, std::string_view password) {
  return base64_text(sha1_bytes(std::string(nonce) + std::string(created) + std::string(password)));
}

UsernameToken username_token(const std::string& user, const std::string& password, double unix_s) {
  if (user.empty()) return {};
  static std::random_device chance;
  std::string nonce;
  for (int i = 0; i < 20; ++i) nonce.push_back(static_cast<char>(chance()));
  const std::string created = utc_text(unix_s);
  return {user, base64_text(nonce), created, password_digest(nonce, created, password)};
}

std::string escaped_xml(std::string_view text) {
  std::string escaped;
  for (const char letter : text) {
    if (letter == '<')
      escaped += "&lt;";
    else if (letter == '>')
      escaped += "&gt;";
    else if (letter == '&')
      escaped += "&amp;";
    else if (letter == '"')
      escaped += "&quot;";
    else if (static_cast<unsigned char>(letter) >= 0x20u || letter == '\n')
      escaped.push_back(letter);
  }
  return escaped;
}

std::string soap_request(const UsernameToken& token, std::string_view body) {
  std::string header;
  if (!token.user.empty())
    header = fmt::format(
        "<s:Header><Security s:mustUnderstand=\"1\" "
        "xmlns=\"http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd\"><UsernameToken>"
        "<Username>{}</Username><Password "
        "Type=\"http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-username-token-profile-1.0#PasswordDigest\">{}"
        "</Password><Nonce "
        "EncodingType=\"http://docs.oasis-open.org/wss/2004/01/"
        "oasis-200401-wss-soap-message-security-1.0#Base64Binary\">{}</Nonce><Created "
        "xmlns=\"http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-utility-1.0.xsd\">{}</Created>"
        "</UsernameToken></Security></s:Header>",
        escaped_xml(token.user), token.digest, token.nonce, token.created);
  return fmt::format(
      "<s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\">{}<s:Body "
      "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
      "xmlns:xsd=\"http://www.w3.org/2001/XMLSchema\">{}</s:Body>"
      "</s:Envelope>",
      header, body);
}

HttpReply http_post(LineSocket& socket, const std::string& path, std::string_view body, double max_s) {
  constexpr int max_lines = 200;
  socket.close();
  socket.begin_exchange(max_s);
  socket.connect();
  const SocketAddress& address = socket.address();
  socket.write(
      fmt::format("POST {} HTTP/1.1\r\nHost: {}:{}\r\nContent-Type: application/soap+xml; charset=utf-8\r\n"
                  "Content-Length: {}\r\nConnection: close\r\n\r\n{}",
                  path, address.host, address.port, body.size(), body));
  HttpReply reply;
  const std::string first = socket.line();
  if (std::sscanf(first.c_str(), "HTTP/%*d.%*d %3d", &reply.status) != 1)
    throw InputError(address.name + ": answers no HTTP");
  std::optional<std::size_t> length;
  bool is_chunked = false;
  std::string line = socket.line();
  for (int i = 0; !line.empty() && i < max_lines; ++i, line = socket.line()) {
    if (begins_with_word(line, "content-length:")) length = whole_size(socket, std::string_view(line).substr(15), 10);
    if (begins_with_word(line, "transfer-encoding:")) is_chunked = line.find("chunked") != std::string::npos;
    if (begins_with_word(line, "www-authenticate: digest")) reply.asks_for_digest = true;
  }
  reply.body = is_chunked ? chunked_body(socket) : length ? socket.bytes(*length) : socket.rest();
  socket.close();
  return reply;
}

}  // namespace alidade
