#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/io/files.h"

namespace alidade {

/// A CSV file as read: header names and text cells. The ONE reader of tables; every fault names file, line and column.
class Csv {
 public:
  /// Throws InputError: unreadable, empty, no header, duplicate column, a row of another length, not text.
  [[nodiscard]] static Csv read(const std::filesystem::path& file);
  [[nodiscard]] static Csv parse(std::string_view text, const std::string& name);

  [[nodiscard]] std::size_t num_rows() const { return rows_.size(); }
  [[nodiscard]] bool has(const std::string& column) const { return columns_.contains(column); }
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] bool is_empty(std::size_t row, const std::string& column) const;

  /// Text of a cell. Throws InputError naming the missing column and the known ones.
  [[nodiscard]] const std::string& text(std::size_t row, const std::string& column) const;
  /// A finite number, |x| ≤ 1e12. Throws `shots.csv:17: column 'range_m': 'nan' is not a finite number`.
  [[nodiscard]] double number(std::size_t row, const std::string& column) const;
  /// An integer in [low, high].
  [[nodiscard]] long integer(std::size_t row, const std::string& column, long low, long high) const;
  /// "file:line: column 'name'" of a cell, to begin a message with.
  [[nodiscard]] std::string where(std::size_t row, const std::string& column) const;

 private:
  std::string name_;
  std::vector<std::string> header_;
  std::map<std::string, std::size_t> columns_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> lines_;
};

}  // namespace alidade
