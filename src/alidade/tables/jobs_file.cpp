#include "alidade/tables/jobs_file.h"

#include <algorithm>

#include "alidade/files/csv.h"

namespace alidade {

std::vector<std::string> words_of_line(std::string_view line, const std::string& where) {
  std::vector<std::string> words;
  bool is_word = false;
  char quote = '\0';
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    const bool is_space = c == ' ' || c == '\t' || c == '\n' || c == '\r';
    if (quote == '\0' && is_space) {
      is_word = false;
      continue;
    }
    if (!is_word) words.emplace_back();
    is_word = true;
    if (c == '\\' && quote != '\'' && i + 1 < line.size()) {
      words.back() += line[++i];
    } else if (quote == '\0' && (c == '"' || c == '\'')) {
      quote = c;
    } else if (c == quote) {
      quote = '\0';
    } else {
      words.back() += c;
    }
  }
  if (quote != '\0') throw InputError(where + ": a quote (" + quote + ") that does not end");
  return words;
}

std::vector<BatchJob> read_jobs(const std::filesystem::path& file) {
  const Csv csv = Csv::read(file);
  if (!csv.has("arguments") && !csv.has("command")) csv.refuse_missing("arguments");
  std::vector<BatchJob> jobs;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    BatchJob job{csv.line(row), std::to_string(row + 1), {}, ""};
    for (const char* const column : {"command", "arguments"}) {
      if (!csv.has(column)) continue;
      try {
        for (std::string& word : words_of_line(csv.text(row, column), csv.where(row, column)))
          job.words.push_back(std::move(word));
      } catch (const InputError& error) {
        job.fault = error.what();
      }
    }
    for (const std::string& column : csv.header()) {
      const std::string& cell = csv.text(row, column);
      if (cell.empty() || column == "command" || column == "arguments") continue;
      if (column == "camera") {
        job.camera = cell;
        continue;
      }
      std::string option = "--" + column;
      std::ranges::replace(option, '_', '-');
      job.words.push_back(std::move(option));
      if (cell != "true") job.words.push_back(cell);
    }
    if (job.words.empty() && job.fault.empty())
      job.fault = csv.where(row, csv.has("arguments") ? "arguments" : "command") + ": is empty";
    jobs.push_back(std::move(job));
  }
  if (jobs.empty()) throw InputError(csv.name() + ": has no rows");
  if (std::ranges::none_of(jobs, &std::string::empty, &BatchJob::fault)) throw InputError(jobs.front().fault);
  return jobs;
}

}  // namespace alidade
