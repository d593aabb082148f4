#pragma once

#include <sys/types.h>

#include <cstddef>
#include <memory>
#include <string>

namespace alidade {

/// Whom to believe: what this machine's authorities vouch for under the host's name; or, where a fingerprint is given,
/// that one certificate alone (cameras sign their own).
struct TlsTrust {
  std::string host;
  std::string fingerprint;  ///< SHA-256 of the certificate, 64 hexadecimal digits; empty: the authorities.
};

/// TLS over a connected socket that does not block.
class TlsSession {
 public:
  /// Shakes hands; `wait` waits until the socket can be written to (true) or read from, false where the time is up.
  /// Null and why, where the other side is not to be believed: nothing was sent to it then.
  template <typename Wait>
  static std::unique_ptr<TlsSession> begin(int socket, const TlsTrust& trust, Wait wait, std::string& fault) {
    std::unique_ptr<TlsSession> session(new TlsSession(socket, trust));
    for (Step step = session->shake_hands(fault); step != Step::done; step = session->shake_hands(fault)) {
      if (step == Step::failed) return nullptr;
      if (wait(step == Step::wants_to_write)) continue;
      fault = "its TLS does not answer in time";
      return nullptr;
    }
    fault = session->distrust(trust);
    return fault.empty() ? std::move(session) : nullptr;
  }
  ~TlsSession();
  TlsSession(const TlsSession&) = delete;
  TlsSession& operator=(const TlsSession&) = delete;

  /// As recv() and send() of a socket that does not block: 0 at its end, −1 with errno.
  [[nodiscard]] ssize_t read(char* bytes, std::size_t count);
  [[nodiscard]] ssize_t write(const char* bytes, std::size_t count);
  /// Decrypted, and not yet read.
  [[nodiscard]] bool has_waiting() const;

 private:
  enum class Step { done, wants_to_read, wants_to_write, failed };
  struct State;
  TlsSession(int socket, const TlsTrust& trust);
  [[nodiscard]] Step shake_hands(std::string& fault);
  [[nodiscard]] std::string distrust(const TlsTrust& trust) const;

  std::unique_ptr<State> state_;
};

}  // namespace alidade
