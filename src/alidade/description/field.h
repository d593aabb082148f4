#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The values that a number may have. NaN and infinity are never allowed.
struct Limits {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool is_above_min = false;  ///< Larger than `min`, not equal.
};

/// Reads and writes a value that is not a plain number: an enum's word, 640x480, 25mm.
struct TextCode {
  std::function<std::string(const std::string& text)> read;  ///< Stores the value; returns its fault, or "".
  std::function<std::string()> write;                        ///< The text that `read` accepts; "" if there is no value.
  std::vector<std::string> words = {};                       ///< All accepted words; empty: too many to list.
  int num_parts = 1;  ///< Number of values, separated by commas or given one after the other; 0: any number.
};

/// One field of a config, described once: command-line options and their help, keys of config files, keyword arguments,
/// limits and docs are derived from it. `value` points into the config that `fields_of` was given, which must outlive
/// the field.
struct Field {
  std::string name;  ///< Name of the config's member, with its unit: "glass_m". The key in a config file.
  std::variant<bool*, int*, double*, std::optional<double>*, std::string*, std::vector<std::string>*, TextCode> value;
  std::string help;                        ///< One line, without a full stop.
  Limits limits = {};                      ///< For numbers.
  std::string form = {};                   ///< Placeholder of the value in help: "WIDTHxHEIGHT"; empty: by its type.
  std::string option = {};                 ///< "--fix", if it is not the name without its unit.
  std::vector<std::string> old_options{};  ///< Earlier names of the option, which are still accepted.
  std::string group = {};                  ///< Heading in the help.
  bool is_required = false;
};
using FieldList = std::vector<Field>;

/// "--glass" for "glass_m": the name without its unit, words joined by dashes.
[[nodiscard]] std::string option_of(const Field& field);

/// Sets a value from its text; lists are given part by part, and the first part replaces the old value (`is_first`).
/// Returns what is wrong in a few words ("'x' is not a finite number"), else "". Flags: true or false.
[[nodiscard]] std::string set_field(const Field& field, const std::string& text, bool is_first = true);

/// The value as set_field() reads it, with parts of a list separated by commas; "" if there is none.
[[nodiscard]] std::string value_text(const Field& field);

/// Placeholder of the value in help: "NUMBER 0..10", "flat|bow|free", "WIDTHxHEIGHT". "" for a flag.
[[nodiscard]] std::string form_text(const Field& field);

/// Faults of the numeric values, one sentence each, by name: "glass_m is 12, not within 0 to 10". It checks a config
/// that a program has filled in the same way as a command line.
[[nodiscard]] std::vector<std::string> faults_of(const FieldList& fields);

/// The words of an enum, each defined once: `words<Shape>` is a list of pairs of value and word.
template <typename Enum>
using WordList = std::vector<std::pair<Enum, std::string>>;

/// TextCode for an enum, by its words.
template <typename Enum>
[[nodiscard]] TextCode words_code(Enum& value, const WordList<Enum>& words) {
  TextCode code;
  for (const auto& [each, word] : words) code.words.push_back(word);
  code.read = [&value, words](const std::string& text) -> std::string {
    std::string list;
    for (const auto& [each, word] : words) {
      if (word == text) {
        value = each;
        return "";
      }
      list += (list.empty() ? "" : ", ") + word;
    }
    return "'" + text + "' is not one of " + list;
  };
  code.write = [&value, words]() -> std::string {
    for (const auto& [each, word] : words) {
      if (each == value) return word;
    }
    return "";
  };
  return code;
}

/// A length in metres, or with its unit (25mm, 2.5cm, 1m); above zero. A bare number outside `min_m` to `max_m` was
/// probably meant in another unit; it is refused with a message that says what it would be.
[[nodiscard]] TextCode length_code(double& value_m, double min_m, double max_m);

/// Two whole numbers from `min` to `max`, "640x480". `example` is shown if the text is not such a pair: "WIDTHxHEIGHT,
/// for example 640x480".
[[nodiscard]] TextCode pair_code(int& first, int& second, int max, const std::string& example, int min = 1);

/// `count` finite numbers, "500,510,400,300". `values` returns the present ones, or none if there is no value.
[[nodiscard]] TextCode numbers_code(int count, const std::function<std::vector<double>()>& values,
                                    const std::function<void(const std::vector<double>&)>& take);

ALIDADE_PUBLIC_END
}  // namespace alidade
