#pragma once

#include <string>
#include <utility>
#include <vector>

#include "alidade/description/field.h"

namespace alidade::python {

/// Values by name, each as the texts that the command line would give: one, or the parts of a list.
using Texts = std::vector<std::pair<std::string, std::vector<std::string>>>;

/// Sets fields by name, or by their option as an identifier. Throws ConfigError naming the field.
void set_fields(const FieldList& fields, const Texts& values);

}  // namespace alidade::python
