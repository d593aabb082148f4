#include "alidade/heads/protocols/tls.h"

#include <cerrno>

#include "alidade/files/files.h"

#if __has_include(<openssl/ssl.h>)
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#endif

namespace alidade {

#if __has_include(<openssl/ssl.h>)

struct TlsSession::State {
  std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context{SSL_CTX_new(TLS_client_method()), &SSL_CTX_free};
  std::unique_ptr<SSL, decltype(&SSL_free)> ssl{nullptr, &SSL_free};
};

namespace {

std::string fingerprint_of(X509* certificate) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int count = 0;
  std::string text;
  if (X509_digest(certificate, EVP_sha256(), digest, &count) != 1) return text;
  constexpr const char* digits = "0123456789abcdef";
  for (unsigned int i = 0; i < count; ++i) {
    text.push_back(digits[digest[i] >> 4]);
    text.push_back(digits[digest[i] & 15]);
  }
  return text;
}

/// −1 and errno as a socket has them; 0 at the end.
ssize_t as_socket(SSL* ssl, int got) {
  if (got > 0) return got;
  const int why = SSL_get_error(ssl, got);
  if (why == SSL_ERROR_ZERO_RETURN) return 0;
  errno = why == SSL_ERROR_WANT_READ || why == SSL_ERROR_WANT_WRITE ? EAGAIN : ECONNRESET;
  return -1;
}

}  // namespace

TlsSession::TlsSession(int socket, const TlsTrust& trust) : state_(std::make_unique<State>()) {
  SSL_CTX* context = state_->context.get();
  SSL_CTX_set_default_verify_paths(context);
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  SSL_CTX_set_options(context, SSL_OP_IGNORE_UNEXPECTED_EOF);  // small servers close without saying so
  state_->ssl.reset(SSL_new(context));
  SSL* ssl = state_->ssl.get();
  SSL_set_fd(ssl, socket);
  SSL_set_verify(ssl, SSL_VERIFY_NONE, nullptr);  // judged by distrust(), before anything is sent
  if (X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(ssl), trust.host.c_str()) != 1) {
    SSL_set1_host(ssl, trust.host.c_str());
    SSL_set_tlsext_host_name(ssl, trust.host.c_str());
  }
}

TlsSession::~TlsSession() = default;

TlsSession::Step TlsSession::shake_hands(std::string& fault) {
  SSL* ssl = state_->ssl.get();
  ERR_clear_error();
  const int got = SSL_connect(ssl);
  if (got == 1) return Step::done;
  const int why = SSL_get_error(ssl, got);
  if (why == SSL_ERROR_WANT_READ) return Step::wants_to_read;
  if (why == SSL_ERROR_WANT_WRITE) return Step::wants_to_write;
  const char* reason = ERR_reason_error_string(ERR_peek_error());
  fault = std::string("speaks no TLS there: ") + (reason != nullptr ? reason : "it closed the connection");
  return Step::failed;
}

std::string TlsSession::distrust(const TlsTrust& trust) const {
  SSL* ssl = state_->ssl.get();
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(SSL_get1_peer_certificate(ssl), &X509_free);
  if (!certificate) return "shows no certificate";
  const std::string fingerprint = fingerprint_of(certificate.get());
  if (!trust.fingerprint.empty())
    return fingerprint == trust.fingerprint ? "" : "its certificate is another one than cert= says: " + fingerprint;
  const long result = SSL_get_verify_result(ssl);
  if (result == X509_V_OK) return "";
  return std::string("its certificate is not trusted (") + X509_verify_cert_error_string(result) +
         "); where it is your camera's own, add cert=" + fingerprint + " to the address";
}

ssize_t TlsSession::read(char* bytes, std::size_t count) {
  ERR_clear_error();
  return as_socket(state_->ssl.get(), SSL_read(state_->ssl.get(), bytes, static_cast<int>(count)));
}

ssize_t TlsSession::write(const char* bytes, std::size_t count) {
  ERR_clear_error();
  return as_socket(state_->ssl.get(), SSL_write(state_->ssl.get(), bytes, static_cast<int>(count)));
}

bool TlsSession::has_waiting() const { return SSL_pending(state_->ssl.get()) > 0; }

#else

struct TlsSession::State {};
TlsSession::TlsSession(int, const TlsTrust&) {}
TlsSession::~TlsSession() = default;
TlsSession::Step TlsSession::shake_hands(std::string& fault) {
  fault = "this alidade was built without OpenSSL (libssl-dev), which https needs";
  return Step::failed;
}
std::string TlsSession::distrust(const TlsTrust&) const { return ""; }
ssize_t TlsSession::read(char*, std::size_t) { return errno = ENOTSUP, -1; }
ssize_t TlsSession::write(const char*, std::size_t) { return errno = ENOTSUP, -1; }
bool TlsSession::has_waiting() const { return false; }

#endif

}  // namespace alidade
