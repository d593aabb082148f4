#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace alidade {

/// One row of a batch: the arguments of a command line after `alidade`, and its camera.
struct BatchJob {
  std::size_t line = 0;  ///< Of the file.
  std::string camera;    ///< As the row says; else its number, from 1.
  std::vector<std::string> words;
  std::string fault;  ///< Of a row that says no command; it fails, and the others run.
};

/// A line's words as a shell takes them: spaces part, "…", '…' and \ quote. Throws InputError beginning with `where`
/// for a quote that does not end.
[[nodiscard]] std::vector<std::string> words_of_line(std::string_view line, const std::string& where);

/// jobs.csv: `arguments` (a line's words, `calibrate photos/17 --board 9x6 --square 0.025`), and of these columns any:
/// `camera` (a name), `command` (before the arguments), and options by name (`board`, `square`, …), each given where
/// its cell is not empty. Throws InputError "jobs.csv:17: column 'arguments': …".
[[nodiscard]] std::vector<BatchJob> read_jobs(const std::filesystem::path& file);

}  // namespace alidade
