#include "alidade/heads/protocols/tls.h"

#include <cerrno>

#include "alidade/files/files.h"

#if __has_include(<openssl/ssl.h>)
#include <dlfcn.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#endif

namespace alidade {

#if __has_include(<openssl/ssl.h>)

namespace {

/// OpenSSL, loaded with the first https address: linked, it would lengthen every start of a program by 2 ms.
struct OpenSsl {
#define ALIDADE_OPENSSL(name) decltype(&::name) name = known<decltype(&::name)>(#name)
  void* library = ::dlopen("libssl.so.3", RTLD_NOW | RTLD_GLOBAL);  // brings libcrypto.so.3
  bool is_whole = library != nullptr;

  template <class Function>
  Function known(const char* name) {
    void* const found = library != nullptr ? ::dlsym(library, name) : nullptr;
    is_whole = is_whole && found != nullptr;
    return reinterpret_cast<Function>(found);
  }
  ALIDADE_OPENSSL(ERR_clear_error);
  ALIDADE_OPENSSL(ERR_peek_error);
  ALIDADE_OPENSSL(ERR_reason_error_string);
  ALIDADE_OPENSSL(EVP_sha256);
  ALIDADE_OPENSSL(SSL_CTX_ctrl);
  ALIDADE_OPENSSL(SSL_CTX_free);
  ALIDADE_OPENSSL(SSL_CTX_new);
  ALIDADE_OPENSSL(SSL_CTX_set_default_verify_paths);
  ALIDADE_OPENSSL(SSL_CTX_set_options);
  ALIDADE_OPENSSL(SSL_connect);
  ALIDADE_OPENSSL(SSL_ctrl);
  ALIDADE_OPENSSL(SSL_free);
  ALIDADE_OPENSSL(SSL_get0_param);
  ALIDADE_OPENSSL(SSL_get1_peer_certificate);
  ALIDADE_OPENSSL(SSL_get_error);
  ALIDADE_OPENSSL(SSL_get_verify_result);
  ALIDADE_OPENSSL(SSL_new);
  ALIDADE_OPENSSL(SSL_pending);
  ALIDADE_OPENSSL(SSL_read);
  ALIDADE_OPENSSL(SSL_set1_host);
  ALIDADE_OPENSSL(SSL_set_fd);
  ALIDADE_OPENSSL(SSL_set_verify);
  ALIDADE_OPENSSL(SSL_write);
  ALIDADE_OPENSSL(TLS_client_method);
  ALIDADE_OPENSSL(X509_VERIFY_PARAM_set1_ip_asc);
  ALIDADE_OPENSSL(X509_digest);
  ALIDADE_OPENSSL(X509_free);
  ALIDADE_OPENSSL(X509_verify_cert_error_string);
#undef ALIDADE_OPENSSL
};

const OpenSsl& open_ssl() {
  static const OpenSsl loaded;
  return loaded;
}

}  // namespace

/// Its functions are those that were loaded: they hide the global ones, from OpenSSL's macros, too.
struct TlsSession::State : OpenSsl {
  SSL_CTX* context = nullptr;
  SSL* ssl = nullptr;

  explicit State(const OpenSsl& functions) : OpenSsl(functions) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (ssl != nullptr) SSL_free(ssl);
    if (context != nullptr) SSL_CTX_free(context);
  }
  void begin(int socket, const TlsTrust& trust) {
    context = SSL_CTX_new(TLS_client_method());
    SSL_CTX_set_default_verify_paths(context);
    SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
    SSL_CTX_set_options(context, SSL_OP_IGNORE_UNEXPECTED_EOF);  // small servers close without saying so
    ssl = SSL_new(context);
    SSL_set_fd(ssl, socket);
    SSL_set_verify(ssl, SSL_VERIFY_NONE, nullptr);  // judged by distrust(), before anything is sent
    if (X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(ssl), trust.host.c_str()) != 1) {
      SSL_set1_host(ssl, trust.host.c_str());
      SSL_set_tlsext_host_name(ssl, trust.host.c_str());
    }
  }
  Step shake_hands(std::string& fault) {
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
  std::string fingerprint_of(X509* certificate) const {
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
  std::string distrust(const TlsTrust& trust) const {
    X509* const certificate = SSL_get1_peer_certificate(ssl);
    if (certificate == nullptr) return "shows no certificate";
    const std::string fingerprint = fingerprint_of(certificate);
    X509_free(certificate);
    if (!trust.fingerprint.empty())
      return fingerprint == trust.fingerprint ? "" : "its certificate is another one than cert= says: " + fingerprint;
    const long result = SSL_get_verify_result(ssl);
    if (result == X509_V_OK) return "";
    return std::string("its certificate is not trusted (") + X509_verify_cert_error_string(result) +
           "); where it is your camera's own, add cert=" + fingerprint + " to the address";
  }
  /// −1 and errno as a socket has them; 0 at the end.
  ssize_t as_socket(int got) const {
    if (got > 0) return got;
    const int why = SSL_get_error(ssl, got);
    if (why == SSL_ERROR_ZERO_RETURN) return 0;
    errno = why == SSL_ERROR_WANT_READ || why == SSL_ERROR_WANT_WRITE ? EAGAIN : ECONNRESET;
    return -1;
  }
  ssize_t read(char* bytes, std::size_t count) {
    ERR_clear_error();
    return as_socket(SSL_read(ssl, bytes, static_cast<int>(count)));
  }
  ssize_t write(const char* bytes, std::size_t count) {
    ERR_clear_error();
    return as_socket(SSL_write(ssl, bytes, static_cast<int>(count)));
  }
};

TlsSession::TlsSession(int socket, const TlsTrust& trust) {
  if (!open_ssl().is_whole) return;
  state_ = std::make_unique<State>(open_ssl());
  state_->begin(socket, trust);
}

TlsSession::~TlsSession() = default;

TlsSession::Step TlsSession::shake_hands(std::string& fault) {
  if (state_) return state_->shake_hands(fault);
  fault = "needs OpenSSL, of which libssl.so.3 is not installed (Debian: libssl3)";
  return Step::failed;
}

std::string TlsSession::distrust(const TlsTrust& trust) const { return state_->distrust(trust); }
ssize_t TlsSession::read(char* bytes, std::size_t count) { return state_->read(bytes, count); }
ssize_t TlsSession::write(const char* bytes, std::size_t count) { return state_->write(bytes, count); }
bool TlsSession::has_waiting() const { return state_->SSL_pending(state_->ssl) > 0; }

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
