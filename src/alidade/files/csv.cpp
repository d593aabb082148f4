#include "alidade/files/csv.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>
#include <utility>

namespace alidade {
namespace {

constexpr double largest_number = 1e12;  // metres, pixels, seconds since 1970: all far below; their squares are finite

/// A cell as it may stand in a message: short, in one line.
std::string in_quotes(std::string_view cell) {
  constexpr std::size_t longest = 40;
  std::string text(cell.substr(0, longest));
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20U) c = ' ';
  }
  return "'" + text + (cell.size() > longest ? "…'" : "'");
}

std::string at_line(const std::string& name, std::size_t line) { return name + ":" + std::to_string(line) + ": "; }

/// True for what no text file holds. UTF-16 is caught by its zero bytes.
bool is_binary(char c) {
  const auto code = static_cast<unsigned char>(c);
  return (code < 0x20U && c != '\n' && c != '\r' && c != '\t') || code == 0x7fU;
}

/// Splits text into rows of cells: RFC 4180, with LF, CRLF or CR ends.
class Splitter {
 public:
  Splitter(std::string_view text, const std::string& name, char separator, std::size_t line = 1)
      : text_(text), name_(name), separator_(separator), line_(line) {}

  /// The next row, blank ones included (one empty cell). None at the end.
  [[nodiscard]] std::optional<CsvRow> next() {
    if (at_ == text_.size()) return std::nullopt;
    CsvRow row{{}, line_};
    do {
      row.cells.push_back(cell());
    } while (take(separator_));
    take('\r');
    take('\n');
    ++line_;
    return row;
  }

 private:
  bool take(char c) {
    if (at_ == text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }

  std::string cell() {
    while (take(' ') || (separator_ != '\t' && take('\t'))) {
    }
    if (take('"')) return quoted_cell();
    const std::size_t end = std::min(text_.find_first_of(ends(), at_), text_.size());
    std::string cell(csv_trimmed(text_.substr(at_, end - at_)));
    at_ = end;
    if (separator_ != ',') std::replace(cell.begin(), cell.end(), ',', '.');
    return cell;
  }

  std::string quoted_cell() {
    const std::size_t begin_line = line_;
    std::string cell;
    while (at_ < text_.size()) {
      const char c = text_[at_++];
      if (c == '"' && !take('"')) {
        while (take(' ') || (separator_ != '\t' && take('\t'))) {
        }
        if (at_ < text_.size() && text_.substr(at_, 1).find_first_of(ends()) == std::string_view::npos) {
          throw InputError(at_line(name_, line_) + "text after a closing quote");
        }
        return cell;
      }
      if (c == '\n') ++line_;
      cell += c;
    }
    throw InputError(at_line(name_, begin_line) + "a quote is opened and never closed");
  }

  [[nodiscard]] const char* ends() const {
    return separator_ == ';' ? ";\r\n" : separator_ == '\t' ? "\t\r\n" : ",\r\n";
  }

  std::string_view text_;
  const std::string& name_;
  char separator_;
  std::size_t at_ = 0;
  std::size_t line_;
};

bool is_blank(const CsvRow& row) { return row.cells.size() == 1 && row.cells[0].empty(); }

void refuse_binary(std::string_view text, const std::string& name, std::size_t first_line = 1) {
  const auto* const bad = std::find_if(text.begin(), text.end(), is_binary);
  if (bad == text.end()) return;
  const auto line = static_cast<std::size_t>(std::count(text.begin(), bad, '\n')) + first_line;
  throw InputError(at_line(name, line) + "is not a text file; a table of comma-separated values is needed");
}

/// The whole of `text` as a number. None if it is not one.
template <typename Number>
std::optional<Number> parse_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// A whole number, also as programs write one that keep all numbers as floating ones: "7.0".
std::optional<long> parse_whole(std::string_view text) {
  if (const std::optional<long> value = parse_number<long>(text)) return value;
  const std::optional<double> value = parse_number<double>(text);
  if (!value || std::trunc(*value) != *value || !(std::abs(*value) <= largest_number)) return std::nullopt;
  return static_cast<long>(*value);
}

/// True for digits that no double can hold, "1e999", which are a number all the same.
bool is_out_of_range(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  return std::from_chars(text.data(), text.data() + text.size(), value).ec == std::errc::result_out_of_range;
}

[[noreturn]] void throw_empty(const std::string& name) {
  throw InputError(name + ": is empty; a header line with the columns' names is needed");
}

[[noreturn]] void throw_blank_line(const std::string& name, std::size_t line) {
  throw InputError(at_line(name, line) + "a blank line inside the table; remove it");
}

void check_length(const CsvRow& row, std::size_t wanted, const std::string& name) {
  if (row.cells.size() == wanted) return;
  throw InputError(at_line(name, row.line) + "has " + std::to_string(row.cells.size()) +
                   (row.cells.size() == 1 ? " cell" : " cells") + ", the header has " + std::to_string(wanted));
}

/// One line with its end, or several where a quoted cell has line ends in it. Empty at the end of the stream.
std::string read_line(std::istream& in, const std::string& name, std::size_t line) {
  constexpr std::size_t longest = std::size_t{16} << 20U;
  std::string text;
  bool is_quoted = false, may_open = true, has_closed = false;
  std::streambuf& buffer = *in.rdbuf();  // get() would look at the stream's state for every character
  for (int code = buffer.sbumpc(); code != std::streambuf::traits_type::eof(); code = buffer.sbumpc()) {
    const char c = static_cast<char>(code);
    text += c;
    if (text.size() > longest) throw InputError(at_line(name, line) + "is longer than 16 MiB");
    const bool closes = is_quoted && c == '"';
    if (closes || (c == '"' && (may_open || has_closed))) is_quoted = !is_quoted;
    has_closed = closes;
    may_open = c == ',' || c == '\r' || (may_open && (c == ' ' || c == '\t'));
    if (c == '\n' && !is_quoted) break;
  }
  return text;
}

/// Takes comments and blank lines before the header away. Returns the line of what is left, the first being 1.
std::size_t skip_comments(std::string_view& text) {
  std::size_t line = 1;
  while (!text.empty()) {
    const std::size_t end = text.find_first_of("\r\n");
    const std::string_view first = text.substr(0, end);
    if (!csv_trimmed(first).empty() && !is_csv_comment(first)) break;
    text.remove_prefix(end == std::string_view::npos ? text.size() : end);
    if (text.starts_with("\r\n")) text.remove_prefix(1);
    if (!text.empty()) text.remove_prefix(1);
    ++line;
  }
  return line;
}

std::size_t count_line_ends(std::string_view text) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_lone_return = text[i] == '\r' && (i + 1 == text.size() || text[i + 1] != '\n');
    if (text[i] == '\n' || is_lone_return) ++count;
  }
  return count;
}

}  // namespace

std::string CsvPlace::text() const { return at_line(file, line) + "column '" + column + "'"; }

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

double csv_number(const std::string& cell, const CsvPlace& place) {
  if (cell.empty()) throw InputError(place.text() + ": is empty; a number is needed");
  const std::optional<double> value = parse_number<double>(cell);
  if (value && std::abs(*value) <= largest_number) return *value;
  const std::string what = place.text() + ": " + in_quotes(cell);
  if (value && !std::isfinite(*value)) throw InputError(what + " is not a finite number");
  if (value || is_out_of_range(cell)) throw InputError(what + " is out of range; numbers up to 1e12 are read");
  throw InputError(what + " is not a number");
}

std::optional<double> finite_number(std::string_view text) {
  constexpr std::string_view spaces = " \t\r\n";
  text.remove_prefix(std::min(text.find_first_not_of(spaces), text.size()));
  text.remove_suffix(text.size() - (text.find_last_not_of(spaces) + 1));
  const std::optional<double> value = parse_number<double>(text);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

SkippedInput skipped_row(const std::string& file, std::string fault) {
  std::size_t line = 0;
  if (fault.starts_with(file + ":")) {
    fault.erase(0, file.size() + 1);
    const char* const begin = fault.data();
    const char* const end = std::from_chars(begin, begin + fault.size(), line).ptr;
    fault.erase(0, static_cast<std::size_t>(end - begin));
    if (fault.starts_with(": ")) fault.erase(0, 2);
  }
  return {file, line, std::move(fault)};
}

Csv Csv::read(const std::filesystem::path& file, bool skip_bad) {
  return parse(read_file(file), file.string(), skip_bad);
}

Csv Csv::parse(std::string_view text, const std::string& name, bool skip_bad) {
  if (skip_bad) return parse_skipping(text, name);
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // byte order mark, as spreadsheets write it
  refuse_binary(text, name);
  Csv csv;
  csv.name_ = name;
  std::size_t blank_line = 0;  // none yet
  const std::size_t first_line = skip_comments(text);
  for (Splitter splitter(text, name, csv_separator(text), first_line); std::optional<CsvRow> row = splitter.next();) {
    if (is_blank(*row)) {
      if (blank_line == 0) blank_line = row->line;
      continue;
    }
    if (csv.header_.empty()) {
      csv.columns_ = csv_columns(*row, name);
      csv.header_ = std::move(row->cells);
      blank_line = 0;
      continue;
    }
    if (blank_line != 0) throw_blank_line(name, blank_line);
    check_length(*row, csv.header_.size(), name);
    csv.rows_.push_back(std::move(row->cells));
    csv.lines_.push_back(row->line);
  }
  if (csv.header_.empty()) throw_empty(name);
  return csv;
}

Csv Csv::parse_skipping(std::string_view text, const std::string& name) {
  std::istringstream in{std::string(text)};
  CsvStream stream(in, name);
  Csv csv = stream.empty_table();
  for (;;) {
    try {
      std::optional<CsvRow> row = stream.next();
      if (!row) return csv;
      csv.rows_.push_back(std::move(row->cells));
      csv.lines_.push_back(row->line);
    } catch (const InputError& error) {
      csv.skipped_.push_back(skipped_row(name, error.what()));
    }
  }
}

void Csv::require(std::span<const std::string> columns) const {
  for (const std::string& column : columns)
    if (!has(column)) refuse_missing(column);
}

void Csv::refuse_missing(const std::string& column, const std::string& hint) const {
  constexpr std::size_t most = 12;  // a log of many points has hundreds
  std::string known;
  for (std::size_t i = 0; i < std::min(most, header_.size()); ++i) known += (i == 0 ? "" : ", ") + header_[i];
  if (header_.size() > most) known += ", …";
  throw InputError(name_ + ": has no column '" + column + "'" + hint + "; it has: " + known);
}

bool Csv::is_empty(std::size_t row, const std::string& column) const { return text(row, column).empty(); }

const std::string& Csv::text(std::size_t row, const std::string& column) const {
  const auto found = columns_.find(column);
  if (found != columns_.end()) return rows_.at(row)[found->second.at];
  refuse_missing(column);
}

double Csv::number(std::size_t row, const std::string& column) const {
  const std::string& cell = text(row, column);
  const CsvColumn& of = columns_.at(column);
  const CsvPlace place{name_, lines_.at(row), header_[of.at]};
  if (of.unit == 1.0) return csv_number(cell, place);
  const bool is_time = of.unit == 0.0 || column.ends_with("_s");
  return is_time ? csv_time_s(cell, of.unit, place) : of.unit * csv_number(cell, place);
}

double Csv::positive(std::size_t row, const std::string& column) const {
  const double value = number(row, column);
  if (!(value > 0.0)) throw InputError(where(row, column) + ": " + in_quotes(text(row, column)) + " is not above zero");
  return value;
}

long Csv::integer(std::size_t row, const std::string& column, long low, long high) const {
  const std::string& cell = text(row, column);
  const std::optional<long> value = parse_whole(cell);
  if (value && low <= *value && *value <= high) return *value;
  throw InputError(where(row, column) + ": " + in_quotes(cell) + " is not a whole number from " + std::to_string(low) +
                   " to " + std::to_string(high));
}

std::string Csv::where(std::size_t row, const std::string& column) const {
  const auto found = columns_.find(column);
  return CsvPlace{name_, lines_.at(row), found == columns_.end() ? column : header_[found->second.at]}.text();
}

void Csv::set_only_row(CsvRow row) {
  lines_.assign(1, row.line);
  rows_.resize(1);
  rows_.front() = std::move(row.cells);
}

CsvStream::CsvStream(std::istream& in, std::string name) : in_(in), name_(std::move(name)) {
  std::optional<CsvRow> header = next_with_content();
  if (!header) throw_empty(name_);
  columns_ = csv_columns(*header, name_);
  header_ = std::move(header->cells);
  header_line_ = header->line;
  blank_line_ = 0;
}

Csv CsvStream::empty_table() const {
  Csv csv;
  csv.name_ = name_;
  csv.header_ = header_;
  csv.columns_ = columns_;
  return csv;
}

std::optional<CsvRow> CsvStream::next() {
  std::optional<CsvRow> row = next_with_content();
  if (!row) return std::nullopt;
  if (const std::size_t blank_line = std::exchange(blank_line_, 0); blank_line != 0) {
    rows_.push_front(std::move(*row));
    throw_blank_line(name_, blank_line);
  }
  check_length(*row, header_.size(), name_);
  return row;
}

/// The next row that is not blank.
std::optional<CsvRow> CsvStream::next_with_content() {
  while (!rows_.empty() || read_rows()) {
    if (rows_.empty()) continue;  // a byte order mark and nothing else
    CsvRow row = std::move(rows_.front());
    rows_.pop_front();
    if (!is_blank(row)) return row;
    if (blank_line_ == 0) blank_line_ = row.line;
  }
  return std::nullopt;
}

/// A line is one row (several, where lines end in CR alone). False at the end.
bool CsvStream::read_rows() {
  const std::string line = read_line(in_, name_, line_);
  if (line.empty()) return false;
  const std::size_t first = line_;
  line_ += count_line_ends(line);
  std::string_view text = line;
  if (first == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  refuse_binary(text, name_, first);
  const std::size_t at = header_.empty() ? first + skip_comments(text) - 1 : first;
  if (header_.empty()) separator_ = csv_separator(text);
  for (Splitter splitter(text, name_, separator_, at); std::optional<CsvRow> row = splitter.next();)
    rows_.push_back(std::move(*row));
  return true;
}

}  // namespace alidade
