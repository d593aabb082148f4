#pragma once

#include <string>

#include "alidade/files/json_value.h"
#include "alidade/reference/result_names.h"

namespace alidade {

/// JSON schema (2020-12) of the document that a command leaves as result.json; `x-files` describes the files beside it.
/// Numbers may be null wherever there is no value. Throws std::out_of_range for a command that leaves none.
[[nodiscard]] JsonValue result_schema(const std::string& command);

}  // namespace alidade
