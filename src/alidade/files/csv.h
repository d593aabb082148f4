#pragma once

#include <deque>
#include <filesystem>
#include <istream>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/files/files.h"

namespace alidade {

/// Position of a cell; `text` is "file:line: column 'name'", with which messages begin.
struct CsvPlace {
  const std::string& file;
  std::size_t line;
  const std::string& column;

  [[nodiscard]] std::string text() const;
};

/// Parses a whole text as a finite number with a decimal point, 1.5e3; it may have spaces around it and one '+'. None
/// if it is not a number.
[[nodiscard]] std::optional<double> finite_number(std::string_view text);

/// A finite number, |x| ≤ 1e12. Throws `shots.csv:17: column 'range_m': 'nan' is not a finite number`.
[[nodiscard]] double csv_number(const std::string& cell, const CsvPlace& place);

/// A row's fault as its line and reason, without the leading "file:line: ". Line 0: the fault names no line.
[[nodiscard]] SkippedInput skipped_row(const std::string& file, std::string fault);

/// Formats text as a cell, quoted if necessary.
[[nodiscard]] std::string csv_cell(const std::string& text);

/// The text without spaces and tabs at both ends.
[[nodiscard]] std::string_view csv_trimmed(std::string_view text);

/// A time in seconds, from a column in seconds (unit 1), ms, µs or ns since 1970; unit 0: judged by its size.
[[nodiscard]] double csv_time_s(const std::string& cell, double unit_s, const CsvPlace& place);

struct CsvRow {
  std::vector<std::string> cells;
  std::size_t line = 1;  ///< Line on which it begins.
};

/// Index of a column, and the value of one of its units in the unit of its name; 0: a clock, judged by size.
struct CsvColumn {
  std::size_t at = 0;
  double unit = 1.0;
};

/// The columns of a header by their names, and by other names under which they may be requested: "pan_deg" also as
/// "pan_rad", "time_ns" as "t_s". Normalises the header: "# time" becomes "time", "pan [deg]" and "pan(deg)" become
/// "pan_deg". Throws InputError for a column without a name, or a duplicate one.
[[nodiscard]] std::map<std::string, CsvColumn> csv_columns(CsvRow& header, const std::string& name);
/// Whether a line before the header is a comment, beginning with # or %, and not the header: "# recorded by …".
[[nodiscard]] bool is_csv_comment(std::string_view line);
/// The separator of cells, judged by the header: a comma; a semicolon, as many spreadsheets write it (with decimal
/// commas in numbers); or a tab.
[[nodiscard]] char csv_separator(std::string_view text);

/// The content of a CSV file: header names and text cells. It is the ONE reader of tables; every fault names file, line
/// and column. Columns are requested in SI units, whatever the unit in the file's header; see csv_columns().
class Csv {
 public:
  /// Throws InputError for a file that is unreadable, empty or not text, has no header or a duplicate column, or a row
  /// of another length. With `skip_bad` such rows are rejected and listed in skipped().
  [[nodiscard]] static Csv read(const std::filesystem::path& file, bool skip_bad = false);
  [[nodiscard]] static Csv parse(std::string_view text, const std::string& name, bool skip_bad = false);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_.at(row); }  ///< Line on which the row begins.
  [[nodiscard]] std::size_t num_rows() const { return rows_.size(); }
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }
  [[nodiscard]] bool has(const std::string& column) const { return columns_.contains(column); }
  /// Throws InputError that names the first missing column of these, and lists those in the file.
  void require(std::span<const std::string> columns) const;
  /// Throws that InputError for this column; `hint` begins with "; ".
  [[noreturn]] void refuse_missing(const std::string& column, const std::string& hint = "") const;
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] bool is_empty(std::size_t row, const std::string& column) const;

  /// Text of a cell. Throws InputError that names the missing column and lists the known ones.
  [[nodiscard]] const std::string& text(std::size_t row, const std::string& column) const;
  [[nodiscard]] double number(std::size_t row, const std::string& column) const;
  /// A number above zero.
  [[nodiscard]] double positive(std::size_t row, const std::string& column) const;
  /// An integer in [low, high]; "7.0" is 7.
  [[nodiscard]] long integer(std::size_t row, const std::string& column, long low, long high) const;
  /// "file:line: column 'name'" of a cell, with which messages begin.
  [[nodiscard]] std::string where(std::size_t row, const std::string& column) const;

  /// Makes this row the only one of the table, with number 0: for a stream, whose faults name its lines.
  void set_only_row(CsvRow row);

 private:
  friend class CsvStream;
  [[nodiscard]] static Csv parse_skipping(std::string_view text, const std::string& name);

  std::string name_;
  std::vector<std::string> header_;
  std::map<std::string, CsvColumn> columns_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> lines_;
  std::vector<SkippedInput> skipped_;
};

/// A CSV table read row by row as it arrives: next() never waits beyond the end of the row it returns.
class CsvStream {
 public:
  /// Reads the header. Throws InputError as Csv does.
  CsvStream(std::istream& in, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] std::size_t header_line() const { return header_line_; }
  /// A table with this header and no rows.
  [[nodiscard]] Csv empty_table() const;
  /// The next row, with as many cells as the header; none at the end. Throws InputError; the next call continues after
  /// the fault.
  [[nodiscard]] std::optional<CsvRow> next();

 private:
  [[nodiscard]] std::optional<CsvRow> next_with_content();
  [[nodiscard]] bool read_rows();

  std::istream& in_;
  std::string name_;
  char separator_ = ',';
  std::vector<std::string> header_;
  std::map<std::string, CsvColumn> columns_;
  std::size_t header_line_ = 0;
  std::size_t line_ = 1, blank_line_ = 0;  ///< Line of the next row; a blank line just passed, 0: none.
  std::deque<CsvRow> rows_;                ///< Rows read but not yet returned.
};

}  // namespace alidade
