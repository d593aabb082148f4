#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "alidade/description/field.h"

namespace alidade {

/// Reads the values of fields from a YAML file of `name: value`, where names are those of the fields ("square_m") or of
/// their options ("square"); lists are [a, b]. Fields for which `is_typed` holds are not changed: the command line
/// takes precedence over the file. Returns the names of the fields in the file. Throws InputError for a file that is
/// not YAML, an unknown key (listing the known ones), a field given twice, or a value that the field does not accept.
std::vector<std::string> read_config(const std::filesystem::path& file, const FieldList& fields,
                                     const std::function<bool(const Field&)>& is_typed);

/// Text of such a file with every field, its present value, and its help as a comment: a template.
[[nodiscard]] std::string config_text(const FieldList& fields);

}  // namespace alidade
