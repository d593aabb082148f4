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

/// Position of a cell; `text` is "file:line: column 'name'", to begin a message with.
struct CsvPlace {
  const std::string& file;
  std::size_t line;
  const std::string& column;

  [[nodiscard]] std::string text() const;
};

/// The whole of a text as a finite number with a decimal point, 1.5e3; spaces around it and one '+' may be there. None:
/// it is none.
[[nodiscard]] std::optional<double> finite_number(std::string_view text);

/// A finite number, |x| ≤ 1e12. Throws `shots.csv:17: column 'range_m': 'nan' is not a finite number`.
[[nodiscard]] double csv_number(const std::string& cell, const CsvPlace& place);

/// A row's fault as its line and reason, freed of the "file:line: " that it begins with. Line 0: it names none.
[[nodiscard]] SkippedInput skipped_row(const std::string& file, std::string fault);

/// Text as a cell: quoted where it must be.
[[nodiscard]] std::string csv_cell(const std::string& text);

/// Without spaces and tabs at its ends.
[[nodiscard]] std::string_view csv_trimmed(std::string_view text);

/// A time as seconds, of a column in seconds (unit 1), ms, µs or ns since 1970; unit 0: by how large the number is.
[[nodiscard]] double csv_time_s(const std::string& cell, double unit_s, const CsvPlace& place);

struct CsvRow {
  std::vector<std::string> cells;
  std::size_t line = 1;  ///< Where it begins.
};

/// Where a column stands, and what one of its numbers is in the unit that its name promises; 0: of a clock, by size.
struct CsvColumn {
  std::size_t at = 0;
  double unit = 1.0;
};

/// The columns of a header by their names, and by what else they may be asked for: "pan_deg" is there as "pan_rad" too,
/// "time_ns" as "t_s". Tidies the header: "# time" is "time", "pan [deg]" and "pan(deg)" are "pan_deg". Throws
/// InputError: a column without a name, or a duplicate one.
[[nodiscard]] std::map<std::string, CsvColumn> csv_columns(CsvRow& header, const std::string& name);
/// A line before the header that begins with # or % and is none itself: "# recorded by …".
[[nodiscard]] bool is_csv_comment(std::string_view line);
/// What stands between cells, by the header: a comma; a semicolon, as spreadsheets of half the world write it (with a
/// comma in their numbers); or a tab.
[[nodiscard]] char csv_separator(std::string_view text);

/// A CSV file as read: header names and text cells. The ONE reader of tables; every fault names file, line and column.
/// Columns are asked for in SI units, whatever the unit in the file's header; see csv_columns().
class Csv {
 public:
  /// Throws InputError: unreadable, empty, no header, duplicate column, a row of another length, not text. With
  /// `skip_bad` such rows are left out and stand in skipped().
  [[nodiscard]] static Csv read(const std::filesystem::path& file, bool skip_bad = false);
  [[nodiscard]] static Csv parse(std::string_view text, const std::string& name, bool skip_bad = false);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_.at(row); }  ///< Where the row begins.
  [[nodiscard]] std::size_t num_rows() const { return rows_.size(); }
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }
  [[nodiscard]] bool has(const std::string& column) const { return columns_.contains(column); }
  /// Throws InputError naming the first of these columns that is missing, and those that there are.
  void require(std::span<const std::string> columns) const;
  /// Throws it for this column; `hint` begins with "; ".
  [[noreturn]] void refuse_missing(const std::string& column, const std::string& hint = "") const;
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] bool is_empty(std::size_t row, const std::string& column) const;

  /// Text of a cell. Throws InputError naming the missing column and the known ones.
  [[nodiscard]] const std::string& text(std::size_t row, const std::string& column) const;
  [[nodiscard]] double number(std::size_t row, const std::string& column) const;
  /// A number above zero.
  [[nodiscard]] double positive(std::size_t row, const std::string& column) const;
  /// An integer in [low, high]; "7.0" is 7.
  [[nodiscard]] long integer(std::size_t row, const std::string& column, long low, long high) const;
  /// "file:line: column 'name'" of a cell, to begin a message with.
  [[nodiscard]] std::string where(std::size_t row, const std::string& column) const;

  /// That row alone is the table from now on, its number 0: of a stream, whose faults name its lines.
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

/// Such a table row by row, as it arrives: nothing is waited for beyond the end of the requested line.
class CsvStream {
 public:
  /// Reads the header. Throws InputError as Csv does.
  CsvStream(std::istream& in, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] std::size_t header_line() const { return header_line_; }
  /// A table with this header and no rows.
  [[nodiscard]] Csv empty_table() const;
  /// The next row, as long as the header; none at the end. Throws InputError; the call after that goes on behind the
  /// fault.
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
  std::size_t line_ = 1, blank_line_ = 0;  ///< Of what comes next; of a blank line just passed, 0: none.
  std::deque<CsvRow> rows_;                ///< Read and not yet given.
};

}  // namespace alidade
