#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/files.h"

namespace YAML {  // NOLINT(readability-identifier-naming): yaml-cpp's own
class Node;
}

/// Functions shared by the readers and writers of YAML files. All throw InputError, `file: key: what`.
namespace alidade::detail {

/// Throws `file: key: what`.
[[noreturn]] void refuse(const std::string& file, const std::string& key, const std::string& what);
/// A number of at most 1e12 in size; otherwise throws.
[[nodiscard]] double checked_number(std::string_view text, const std::string& file, const std::string& key);
/// An image's width or height: a whole number from 1 to 1 000 000.
[[nodiscard]] int checked_size(double value, const std::string& file, const std::string& key);
/// Shortest text that reads back as the same double, always with a point or an exponent.
[[nodiscard]] std::string number_text(double value);
/// Keys of the run's verdict that a file holds, beside those of the estimate.
inline constexpr std::array<const char*, 3> verdict_keys{"verdict", "verdict_sentence", "verdict_cause"};

/// One line of text as a YAML string in double quotes.
[[nodiscard]] std::string quoted_text(const std::string& text);
[[nodiscard]] std::string number_list(const std::vector<double>& values);

/// The entries of a YAML map, with the file's name in every message.
class Fields {
 public:
  /// Throws if `map` is not a map, or a key appears twice. `prefix` is put before the keys in messages ("cam0.").
  Fields(const YAML::Node& map, std::string file, std::string prefix = "");
  Fields(const YAML::Node&& map, std::string file, std::string prefix = "") = delete;  // it would not outlive this line

  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] double number(const std::string& key) const;
  [[nodiscard]] int size(const std::string& key) const;
  [[nodiscard]] std::string text(const std::string& key) const;
  [[nodiscard]] std::vector<double> numbers(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> texts(const std::string& key) const;
  /// The numbers of {rows, cols, data}, row-major. Throws if there are not rows × cols of them.
  [[nodiscard]] std::vector<double> matrix(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> keys() const;
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] std::string full(const std::string& key) const { return prefix_ + key; }

 private:
  [[nodiscard]] YAML::Node at(const std::string& key) const;

  const YAML::Node& map_;
  std::string file_;
  std::string prefix_;
};

/// Parses text; if it is not YAML, the message begins with `file` and the line.
[[nodiscard]] YAML::Node load_yaml(const std::string& text, const std::string& file);

/// Throws for a key that is not among `known`; `what` is the kind of map: "a beam".
void refuse_unknown_keys(const Fields& fields, const std::vector<std::string>& known, std::string_view what);

/// Three numbers.
[[nodiscard]] Eigen::Vector3d read_vector(const Fields& fields, const std::string& key);

/// The covariance of `key`: {names, upper}: upper triangle, row-major, in the order of `names`, which are among
/// `known`; parameters that are not named are fixed and have zero rows. Square, with the size of `known`. Throws if the
/// matrix is not a covariance. `of` is what has the parameters: "the model".
[[nodiscard]] Eigen::MatrixXd read_covariance(const YAML::Node& node, const Fields& parent,
                                              const std::vector<std::string>& known, std::string_view of);

}  // namespace alidade::detail
