#pragma once

#include <filesystem>

#include "alidade/description/field.h"

namespace CLI {
class App;
}

namespace alidade::cli {

/// An option for each field, with its help, limits and default. Whether a required one is there is not seen here, as a
/// config file may have it: see take_config().
void add_fields(CLI::App& command, const FieldList& fields);

/// After the line has been parsed: values of the fields that stand in the file (if there is one) and were not typed;
/// then, whether all that is required is there, and nothing given by an earlier name of its option as well. Throws
/// InputError about the file, UsageError about the line.
void take_config(const CLI::App& command, const FieldList& fields, const std::filesystem::path& file);

}  // namespace alidade::cli
