#include "alidade/formats/intrinsics_file.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "alidade/files/csv.h"
#include "alidade/observe/report.h"

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

namespace {

/// The estimate of a row that has one.
IntrinsicsSample lens_of_row(const Csv& csv, std::size_t row) {
  constexpr std::array<const char*, 4> values{"fx", "fy", "cx", "cy"},
      sigmas{"sigma_fx", "sigma_fy", "sigma_cx", "sigma_cy"};
  IntrinsicsSample now;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    now.k[k] = i < 2 ? csv.positive(row, values[i]) : csv.number(row, values[i]);
    if (csv.is_empty(row, sigmas[i]))
      throw InputError(csv.where(row, sigmas[i]) +
                       ": is empty; observe by a method that states σ (hybrid, window, batch)");
    now.sigma[k] = csv.number(row, sigmas[i]);
    if (now.sigma[k] < 0.0) throw InputError(csv.where(row, sigmas[i]) + ": is below zero");
  }
  return now;
}

}  // namespace

IntrinsicsHistory read_intrinsics_history(const std::filesystem::path& file) {
  const Csv csv = Csv::read(file);
  csv.require(std::vector<std::string>{"t_s", "fx", "fy", "cx", "cy", "sigma_fx", "sigma_fy", "sigma_cx", "sigma_cy"});
  IntrinsicsHistory history;
  history.name = file.string();
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const double t_s = csv.number(row, "t_s");
    if (row > 0 && !(t_s > history.until_s))
      throw InputError(csv.where(row, "t_s") + ": '" + csv.text(row, "t_s") + "' does not come after the row before");
    if (row == 0) history.from_s = t_s;
    history.until_s = t_s;
    if (csv.is_empty(row, "fx")) continue;
    history.t_s.push_back(t_s);
    history.lens.push_back(lens_of_row(csv, row));
  }
  if (history.lens.empty()) throw InputError(file.string() + ": has no row with an estimate");
  return history;
}

}  // namespace alidade
