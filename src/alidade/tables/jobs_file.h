#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace alidade {

/// One row of a batch: the arguments of a command line after `alidade`, and its camera.
struct BatchJob {
  std::size_t line = 0;  ///< Line in the file.
  std::string camera;    ///< As given in the row; else its number, from 1.
  std::vector<std::string> words;
  std::string fault;  ///< Fault of a row without a valid command; that row fails, the others run.
};

/// Splits a line into words as a shell does: at spaces, with "…", '…' and \ for quoting. Throws InputError beginning
/// with `where` for an unterminated quote.
[[nodiscard]] std::vector<std::string> words_of_line(std::string_view line, const std::string& where);

/// Reads jobs.csv: `arguments` (a line's words, `calibrate photos/17 --board 9x6 --square 0.025`), and any of these
/// columns: `camera` (a name), `command` (before the arguments), and options by name (`board`, `square`, …), each given
/// if its cell is not empty. Throws InputError "jobs.csv:17: column 'arguments': …".
[[nodiscard]] std::vector<BatchJob> read_jobs(const std::filesystem::path& file);

}  // namespace alidade
