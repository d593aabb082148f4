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

/// Which numbers a field may have. NaN and infinity it may never have.
struct Limits {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool is_above_min = false;  ///< Larger than `min`, not equal.
};

/// How a value that is no plain number is written: an enum's word, 640x480, 25mm.
struct TextCode {
  std::function<std::string(const std::string& text)> read;  ///< Takes it over; what is wrong with it, else "".
  std::function<std::string()> write;                        ///< As `read` takes it; "" where there is no value.
  std::vector<std::string> words = {};                       ///< All that it may be; empty: too many to list.
  int num_parts = 1;  ///< More: so many values, separated by commas or given one after the other; 0: any number.
};

/// One field of a config, described once. Options of the command line and their help, keys of a config file, keyword
/// arguments, limits and docs come from here. `value` points into the config that `fields_of` was given: it must
/// outlive the field.
struct Field {
  std::string name;  ///< Of the config's member, with its unit: "glass_m". The key in a config file.
  std::variant<bool*, int*, double*, std::optional<double>*, std::string*, std::vector<std::string>*, TextCode> value;
  std::string help;                        ///< One line, without a stop.
  Limits limits = {};                      ///< Of a number.
  std::string form = {};                   ///< Placeholder of the value in help: "WIDTHxHEIGHT"; else by its type.
  std::string option = {};                 ///< "--fix", where it is not the name without its unit.
  std::vector<std::string> old_options{};  ///< Earlier names of the option, which stay accepted.
  std::string group = {};                  ///< Heading in help.
  bool is_required = false;
};
using FieldList = std::vector<Field>;

/// "--glass" of "glass_m": the name without its unit, words joined by dashes.
[[nodiscard]] std::string option_of(const Field& field);

/// Takes over a value from its text; lists are given part by part, and the first replaces the old value
/// (`is_first`). What is wrong with it in a few words ("'x' is not a finite number"), else "". Flags: true or false.
[[nodiscard]] std::string set_field(const Field& field, const std::string& text, bool is_first = true);

/// The value as set_field() takes it; parts of a list are separated by commas; "" where there is none.
[[nodiscard]] std::string value_text(const Field& field);

/// Placeholder of the value in help: "NUMBER 0..10", "flat|bow|free", "WIDTHxHEIGHT". "" of a flag.
[[nodiscard]] std::string form_text(const Field& field);

/// What is wrong with the values that numbers have, one sentence each, by name: "glass_m is 12, not within 0 to 10".
/// A config that a program filled is checked by it as a command line is.
[[nodiscard]] std::vector<std::string> faults_of(const FieldList& fields);

/// The words of an enum, each in one place: `words<Shape>` is a list of pairs of value and word.
template <typename Enum>
using WordList = std::vector<std::pair<Enum, std::string>>;

/// An enum's code by its words.
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
/// meant in another unit, and is refused with what it would be.
[[nodiscard]] TextCode length_code(double& value_m, double min_m, double max_m);

/// Two whole numbers of `min` or more, "640x480". `example` is shown where the text is none: "WIDTHxHEIGHT, for example
/// 640x480".
[[nodiscard]] TextCode pair_code(int& first, int& second, int max, const std::string& example, int min = 1);

/// So many finite numbers, "500,510,400,300". `values`: those that there are now; none: no value.
[[nodiscard]] TextCode numbers_code(int count, const std::function<std::vector<double>()>& values,
                                    const std::function<void(const std::vector<double>&)>& take);

ALIDADE_PUBLIC_END
}  // namespace alidade
