#include "alidade/io/intrinsics_file.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <stdexcept>

#include "alidade/observe/observe.h"

namespace alidade {
namespace {

void append_number(std::string& text, double value, int decimals) {
  text += ',';
  if (std::isfinite(value)) fmt::format_to(std::back_inserter(text), "{:.{}f}", value, decimals);
}

}  // namespace

std::string intrinsics_csv(std::span<const double> t_s, std::span<const IntrinsicsEstimate> estimates) {
  if (t_s.size() != estimates.size()) throw std::logic_error("intrinsics_csv: times and estimates differ in number");
  std::string text = "t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event\n";
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const IntrinsicsEstimate& estimate = estimates[i];
    fmt::format_to(std::back_inserter(text), "{:.9f}", t_s[i]);
    if (estimate.has_value) {
      for (const double value : estimate.values()) append_number(text, value, 6);
      for (const double sigma : estimate.sigma) append_number(text, sigma, 6);
      append_number(text, estimate.nis, 4);
    } else {
      text += ",,,,,,,,,";
    }
    fmt::format_to(std::back_inserter(text), ",{}\n", event_name(estimate.event));
  }
  return text;
}

}  // namespace alidade
