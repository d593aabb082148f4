#include "alidade/files/yaml_fields.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "alidade/geometry/covariance.h"

namespace alidade::detail {

void refuse(const std::string& file, const std::string& key, const std::string& what) {
  throw InputError(key.empty() ? file + ": " + what : file + ": " + key + ": " + what);
}

double checked_number(std::string_view text, const std::string& file, const std::string& key) {
  std::string_view digits = text;
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool is_number = error == std::errc{} && end == digits.data() + digits.size() && std::isfinite(value);
  if (!is_number) refuse(file, key, fmt::format("'{}' is not a finite number", text.substr(0, 40)));
  if (!(std::abs(value) <= 1e12)) refuse(file, key, fmt::format("{} is beyond 1e12", text.substr(0, 40)));
  return value;
}

int checked_size(double value, const std::string& file, const std::string& key) {
  if (!(value >= 1.0 && value <= 1e6) || value != std::floor(value)) {
    refuse(file, key, fmt::format("{} is not an image's size in pixels (1 to 1000000)", value));
  }
  return static_cast<int>(value);
}

std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  // YAML 1.1, which PyYAML reads, knows no number with an exponent and without a point: 1e-05 would be a text.
  if (text.find_first_of(".n") == std::string::npos) text.insert(std::min(text.find('e'), text.size()), ".0");
  return text;
}

std::string quoted_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + "\"";
}

std::string number_list(const std::vector<double>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

Fields::Fields(const YAML::Node& map, std::string file, std::string prefix)
    : map_(map), file_(std::move(file)), prefix_(std::move(prefix)) {
  if (!map_.IsMap())
    refuse(file_, prefix_.empty() ? "" : prefix_.substr(0, prefix_.size() - 1),
           "is not a table of keys, `key: value` a line");
  std::set<std::string> seen;
  for (const std::string& key : keys()) {
    if (!seen.insert(key).second) refuse(file_, full(key), "appears twice");
  }
}

std::vector<std::string> Fields::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : map_) {
    if (!entry.first.IsScalar()) refuse(file_, prefix_, "has a key that is not a word");
    names.push_back(entry.first.Scalar());
  }
  return names;
}

bool Fields::has(const std::string& key) const { return map_[key].IsDefined() && !map_[key].IsNull(); }

YAML::Node Fields::at(const std::string& key) const {
  const YAML::Node node = map_[key];
  if (!node.IsDefined() || node.IsNull()) refuse(file_, full(key), "is missing");
  return node;
}

double Fields::number(const std::string& key) const { return checked_number(text(key), file_, full(key)); }

int Fields::size(const std::string& key) const { return checked_size(number(key), file_, full(key)); }

std::string Fields::text(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsScalar()) refuse(file_, full(key), "is not a single value");
  return node.Scalar();
}

std::vector<std::string> Fields::texts(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence()) refuse(file_, full(key), "is not a list");
  if (node.size() > 10000) refuse(file_, full(key), "has more than 10000 entries");
  std::vector<std::string> entries;
  for (const auto& entry : node) {
    if (!entry.IsScalar()) refuse(file_, full(key), "has an entry that is not a single value");
    entries.push_back(entry.Scalar());
  }
  return entries;
}

std::vector<double> Fields::numbers(const std::string& key) const {
  std::vector<double> values;
  for (const std::string& entry : texts(key)) values.push_back(checked_number(entry, file_, full(key)));
  return values;
}

std::vector<double> Fields::matrix(const std::string& key) const {
  const YAML::Node node = at(key);
  if (node.IsSequence()) return numbers(key);
  const Fields entries(node, file_, full(key) + ".");
  std::vector<double> data = entries.numbers("data");
  const double rows = entries.number("rows"), cols = entries.number("cols");
  if (rows * cols != static_cast<double>(data.size())) {
    refuse(file_, full(key), fmt::format("{} numbers are not {} rows of {}", data.size(), rows, cols));
  }
  return data;
}

YAML::Node load_yaml(const std::string& text, const std::string& file) {
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}:{}: is not YAML: {}", file, error.mark.line + 1, error.msg));
  }
}

void refuse_unknown_keys(const Fields& fields, const std::vector<std::string>& known, std::string_view what) {
  for (const std::string& key : fields.keys()) {
    if (std::find(known.begin(), known.end(), key) == known.end())
      refuse(fields.file(), fields.full(key),
             fmt::format("is not a key of {}; known: {}", what, fmt::join(known, " ")));
  }
}

Eigen::Vector3d read_vector(const Fields& fields, const std::string& key) {
  const std::vector<double> numbers = fields.numbers(key);
  if (numbers.size() != 3) refuse(fields.file(), fields.full(key), "must be three numbers");
  return Eigen::Vector3d(numbers.data());
}

namespace {

/// Indices of the named parameters among the known ones.
std::vector<Eigen::Index> places_of(const std::vector<std::string>& names, const std::vector<std::string>& known,
                                    const Fields& fields, std::string_view of) {
  std::vector<Eigen::Index> places;
  for (const std::string& name : names) {
    const auto found = std::find(known.begin(), known.end(), name);
    if (found == known.end())
      refuse(fields.file(), fields.full("names"),
             fmt::format("'{}' is no parameter of {}; it has {}", name, of, fmt::join(known, ", ")));
    const Eigen::Index at = found - known.begin();
    if (std::find(places.begin(), places.end(), at) != places.end())
      refuse(fields.file(), fields.full("names"), "'" + name + "' appears twice");
    places.push_back(at);
  }
  return places;
}

void refuse_impossible(const Eigen::MatrixXd& cov, const std::vector<std::string>& known, const Fields& fields) {
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    for (Eigen::Index j = 0; j < cov.rows(); ++j) {
      if (cov(i, i) >= 0.0 && std::abs(cov(i, j)) <= std::sqrt(cov(i, i) * cov(j, j)) * (1.0 + 1e-9)) continue;
      refuse(fields.file(), fields.full("upper"),
             fmt::format("{} and {} cannot vary together like that: it is not a covariance",
                         known[static_cast<std::size_t>(i)], known[static_cast<std::size_t>(j)]));
    }
  }
  constexpr double of_digits = 1e-6;  // that were cut off
  if (!is_covariance(cov, of_digits))
    refuse(fields.file(), fields.full("upper"), "is not a covariance: an eigenvalue is below zero");
}

}  // namespace

Eigen::MatrixXd read_covariance(const YAML::Node& node, const Fields& parent, const std::vector<std::string>& known,
                                std::string_view of) {
  const Fields fields(node, parent.file(), parent.full("covariance."));
  refuse_unknown_keys(fields, {"names", "upper"}, "a covariance");
  const std::vector<std::string> names = fields.texts("names");
  const std::vector<double> upper = fields.numbers("upper");
  if (upper.size() != names.size() * (names.size() + 1) / 2) {
    refuse(fields.file(), fields.full("upper"),
           fmt::format("{} numbers are not the upper triangle of {} parameters", upper.size(), names.size()));
  }
  const std::vector<Eigen::Index> at = places_of(names, known, fields, of);
  const auto size = static_cast<Eigen::Index>(known.size());
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(size, size);
  std::size_t next = 0;
  for (std::size_t i = 0; i < at.size(); ++i)
    for (std::size_t j = i; j < at.size(); ++j) cov(at[i], at[j]) = cov(at[j], at[i]) = upper[next++];
  refuse_impossible(cov, known, fields);
  return cov;
}

}  // namespace alidade::detail
