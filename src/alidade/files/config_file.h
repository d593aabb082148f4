#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "alidade/description/field.h"

namespace alidade {

/// Takes over the values of fields from a YAML file of `name: value`, the names those of the fields ("square_m") or of
/// their options ("square"); lists as [a, b]. Those for which `is_typed` are left as they are: what was typed beats the
/// file. Returns the names of the fields that stand in the file. Throws InputError: not YAML, a key that is no field
/// (the known are named), a field given twice, a value that the field does not take.
std::vector<std::string> read_config(const std::filesystem::path& file, const FieldList& fields,
                                     const std::function<bool(const Field&)>& is_typed);

/// The same file with every field, its value now, and its help as a comment: to begin with.
[[nodiscard]] std::string config_text(const FieldList& fields);

}  // namespace alidade
