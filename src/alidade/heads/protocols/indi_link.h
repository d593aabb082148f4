#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/heads/protocols/line_socket.h"

namespace alidade {

/// Takes whole elements off the front of an XML stream that never ends: INDI's messages, one after the other.
class XmlElements {
 public:
  /// Throws InputError, which begins with `where`, at what is no XML, or an element without end.
  explicit XmlElements(std::string where) : where_(std::move(where)) {}
  void push(std::string_view text) { text_ += text; }
  /// The next whole element; empty while there is none.
  [[nodiscard]] std::string next();

 private:
  std::string where_, text_;
  std::size_t looked_ = 0;  ///< In `text_`, for the end of the element that has begun.
};

/// A property of an INDI device as it was reported last.
struct IndiProperty {
  std::string state;                          ///< Idle, Ok, Busy, Alert.
  std::map<std::string, std::string> values;  ///< Text of each member.
  std::string format;                         ///< Of a BLOB: ".fits".
  double t_s = 0.0;                           ///< When it came.
  std::size_t count = 0;                      ///< How often.
};

/// INDI's protocol with one device: what it says is kept, and commands are sent.
class IndiLink {
 public:
  /// indi://HOST:PORT/DEVICE. Throws InputError: nobody answers, built without pugixml.
  IndiLink(const std::string& url, double timeout_s);

  /// Reads what has come, for a tenth of a second at most; waits so long for the first of it.
  void take(double wait_s);
  /// For how long there has been more than `take` could read: what is known is that old at least.
  [[nodiscard]] double behind_s() const;
  /// Until the property is there. Throws InputError: it is not, within so many seconds.
  const IndiProperty& wait_for(const std::string& property, double max_s,
                               const std::function<bool(const IndiProperty&)>& is_so = {});
  [[nodiscard]] const IndiProperty* find(const std::string& property) const;
  void set_numbers(const std::string& property, const std::vector<std::pair<std::string, double>>& values);
  void set_switch(const std::string& property, const std::string& on);
  void send(const std::string& xml) { socket_.write(xml); }
  void connect_again();
  /// The driver's connection with its device, where it has none. Throws InputError: not within so many seconds.
  void connect_device(double max_s);

  [[nodiscard]] const std::string& device() const { return device_; }
  [[nodiscard]] const std::string& name() const { return socket_.address().name; }
  [[nodiscard]] const std::vector<std::string>& devices() const { return devices_; }

 private:
  void hear(const std::string& element);

  std::string device_;
  LineSocket socket_;
  XmlElements elements_;
  std::map<std::string, IndiProperty> properties_;
  std::vector<std::string> devices_;
  std::optional<double> behind_since_s_;
};

/// Number of "12.5", "-12:30:15" or "12 30 15"; NaN of what is none.
[[nodiscard]] double sexagesimal(const std::string& text);

}  // namespace alidade
