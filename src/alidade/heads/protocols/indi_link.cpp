#include "alidade/heads/protocols/indi_link.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/heads/head_device.h"
#include "alidade/heads/protocols/soap.h"

#if __has_include(<pugixml.hpp>)
#include <pugixml.hpp>
#endif

namespace alidade {
namespace {

/// After "indi://HOST:PORT/", up to a '?', with %20 for what is no letter.
std::string device_of(const std::string& url) {
  const std::size_t slash = url.find('/', std::string_view("indi://").size());
  std::string text = slash == std::string::npos ? "" : url.substr(slash + 1), name;
  text.resize(std::min(text.size(), text.find('?')));
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size()) {
      name.push_back(static_cast<char>(std::strtol(text.substr(i + 1, 2).c_str(), nullptr, 16)));
      i += 2;
    } else {
      name.push_back(text[i]);
    }
  }
  return name;
}

/// Of a tag from `begin` on: the place behind its '>'; npos: not there yet. Quotes may hold one.
std::size_t end_of_tag(const std::string& text, std::size_t begin) {
  char quote = 0;
  for (std::size_t i = begin; i < text.size(); ++i) {
    if (quote != 0) {
      if (text[i] == quote) quote = 0;
    } else if (text[i] == '"' || text[i] == '\'') {
      quote = text[i];
    } else if (text[i] == '>') {
      return i + 1;
    }
  }
  return std::string::npos;
}

}  // namespace

std::string XmlElements::next() {
  constexpr std::size_t longest = 1 << 28, longest_tag = 1 << 16;
  const std::size_t begin = text_.find_first_not_of(" \t\r\n");
  if (begin == std::string::npos) {
    text_.clear();
    return "";
  }
  if (text_[begin] != '<' || text_.size() > longest) throw InputError(where_ + ": what comes is no INDI");
  const std::size_t tag_end = end_of_tag(text_, begin);
  if (tag_end == std::string::npos) {
    if (text_.size() - begin > longest_tag) throw InputError(where_ + ": what comes is no INDI");
    return "";
  }
  std::size_t end = tag_end;
  const bool is_whole = text_[tag_end - 2] == '/' || text_[begin + 1] == '?' || text_[begin + 1] == '!';
  if (!is_whole) {
    const std::size_t name_end = text_.find_first_of(" \t\r\n/>", begin);
    const std::string closing = "</" + text_.substr(begin + 1, name_end - begin - 1) + ">";
    const std::size_t at = text_.find(closing, std::max(tag_end, looked_));
    if (at == std::string::npos) {
      looked_ = text_.size() > closing.size() ? text_.size() - closing.size() : 0;
      return "";
    }
    end = at + closing.size();
  }
  std::string element = text_.substr(begin, end - begin);
  text_.erase(0, end);
  looked_ = 0;
  return element;
}

double sexagesimal(const std::string& text) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0, unit = 1.0;
  bool is_below_zero = false;
  std::size_t at = 0;
  for (int part = 0; part < 3 && at != std::string::npos; ++part, unit /= 60.0) {
    const std::size_t end = text.find_first_of(": ", at);
    const std::optional<double> value = finite_number(text.substr(at, end - at));
    if (!value || (part > 0 && std::signbit(*value))) return none;
    if (part == 0) is_below_zero = std::signbit(*value);
    sum += std::abs(*value) * unit;
    at = text.find_first_not_of(' ', end == std::string::npos ? end : end + 1);
  }
  if (at != std::string::npos) return none;
  return is_below_zero ? -sum : sum;
}

IndiLink::IndiLink(const std::string& url, double timeout_s)
    : device_(device_of(url)), socket_(address_of(url, "indi://", 7624), timeout_s), elements_(socket_.address().name) {
#if !__has_include(<pugixml.hpp>)
  throw InputError(name() + ": this alidade was built without libpugixml, which reads what INDI says");
#endif
  connect_again();
}

void IndiLink::connect_again() {
  socket_.close();
  socket_.connect();
  elements_ = XmlElements(name());
  behind_since_s_.reset();
  socket_.write("<getProperties version=\"1.7\"/>\n");
}

void IndiLink::take(double wait_s) {
  constexpr double most_s = 0.1;  // who says more than can be read keeps nobody from stopping the head
  const std::shared_ptr<HeadClock> clock = machine_clock();
  const double until_s = clock->now_s() + wait_s + most_s;
  for (std::string text = socket_.some(wait_s); !text.empty(); text = socket_.some(0.0)) {
    elements_.push(text);
    for (std::string element = elements_.next(); !element.empty(); element = elements_.next()) hear(element);
    if (clock->now_s() < until_s) continue;
    if (!behind_since_s_) behind_since_s_ = clock->now_s();
    return;
  }
  behind_since_s_.reset();
}

double IndiLink::behind_s() const { return behind_since_s_ ? machine_clock()->now_s() - *behind_since_s_ : 0.0; }

void IndiLink::hear(const std::string& element) {
#if __has_include(<pugixml.hpp>)
  pugi::xml_document document;
  if (!document.load_buffer(element.data(), element.size())) throw InputError(name() + ": what comes is no INDI");
  const pugi::xml_node root = document.document_element();
  const std::string device = root.attribute("device").value(), property = root.attribute("name").value();
  constexpr std::size_t most_devices = 1000;
  if (!device.empty() && devices_.size() < most_devices && std::ranges::find(devices_, device) == devices_.end())
    devices_.push_back(device);
  if (device != device_ || property.empty()) return;
  if (std::string_view(root.name()) == "delProperty") {
    properties_.erase(property);
    return;
  }
  IndiProperty& kept = properties_[property];
  if (root.attribute("state")) kept.state = root.attribute("state").value();
  for (const pugi::xml_node& each : root.children()) {
    std::string text = each.child_value();
    const std::size_t first = text.find_first_not_of(" \t\r\n"), last = text.find_last_not_of(" \t\r\n");
    kept.values[each.attribute("name").value()] =
        first == std::string::npos ? "" : text.substr(first, last - first + 1);
    if (each.attribute("format")) kept.format = each.attribute("format").value();
  }
  kept.t_s = machine_clock()->now_s();
  ++kept.count;
#else
  (void)element;
#endif
}

const IndiProperty* IndiLink::find(const std::string& property) const {
  const auto found = properties_.find(property);
  return found == properties_.end() ? nullptr : &found->second;
}

const IndiProperty& IndiLink::wait_for(const std::string& property, double max_s,
                                       const std::function<bool(const IndiProperty&)>& is_so) {
  constexpr double step_s = 0.05;
  const std::shared_ptr<HeadClock> clock = machine_clock();
  for (const double until_s = clock->now_s() + max_s;;) {
    take(step_s);
    const IndiProperty* found = find(property);
    if (found != nullptr && (!is_so || is_so(*found))) return *found;
    if (clock->now_s() > until_s) break;
  }
  std::string known;
  for (const std::string& each : devices_) known += (known.empty() ? "" : ", ") + each;
  if (std::ranges::find(devices_, device_) == devices_.end())
    throw InputError(fmt::format("{}: no device '{}'; there are: {}", name(), device_, known.empty() ? "none" : known));
  throw InputError(fmt::format("{}: '{}' says nothing of {} within {:g} s", name(), device_, property, max_s));
}

void IndiLink::connect_device(double max_s) {
  const auto is_on = [](const IndiProperty& property) {
    const auto found = property.values.find("CONNECT");
    return found != property.values.end() && found->second == "On";
  };
  if (is_on(wait_for("CONNECTION", max_s))) return;
  set_switch("CONNECTION", "CONNECT");
  (void)wait_for("CONNECTION", max_s, is_on);
}

void IndiLink::set_numbers(const std::string& property, const std::vector<std::pair<std::string, double>>& values) {
  std::string inside;
  for (const auto& [member, value] : values)
    inside += fmt::format("<oneNumber name=\"{}\">{:.10g}</oneNumber>", member, value);
  send(fmt::format("<newNumberVector device=\"{}\" name=\"{}\">{}</newNumberVector>\n", escaped_xml(device_), property,
                   inside));
}

void IndiLink::set_switch(const std::string& property, const std::string& on) {
  send(fmt::format(
      "<newSwitchVector device=\"{}\" name=\"{}\"><oneSwitch name=\"{}\">On</oneSwitch></newSwitchVector>\n",
      escaped_xml(device_), property, on));
}

}  // namespace alidade
