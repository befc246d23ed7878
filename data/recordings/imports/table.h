// Numbers in rows and columns, as other programs write them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace supertac {

struct Table {
  std::vector<std::string> names;   ///< of the columns; empty where the file names none
  std::vector<std::size_t> shape;   ///< of a row: {columns}, or of an array's {height, width, ...}
  std::size_t columns = 0;          ///< numbers in a row
  std::vector<double> values;       ///< row after row
  std::vector<std::size_t> lines;   ///< of a text: the line that each row stands in, from 1
  std::vector<std::size_t> places;  ///< of a text: the same, remarks and empty lines not counted
  std::size_t dropped = 0;          ///< lines of a text that have other columns, or no numbers

  std::size_t rows() const { return columns == 0 ? 0 : values.size() / columns; }
  std::span<const double> row(std::size_t i) const { return {values.data() + i * columns, columns}; }
  /// A column by its name or its number, from 0. Throws std::invalid_argument that lists what there is.
  std::size_t column(const std::string& name) const;
};

/// Reads FILE.npy (NumPy's format 1 to 3: little endian, C order, integers and floats; the first axis counts
/// the rows) or text: a row a line, separated by commas, semicolons, tabs or blanks, '#' before a remark,
/// names in the first line where that holds no number. Lines that are not as long as most, or hold what is no
/// number, are dropped and counted. Throws FileError: more than 4 GiB, another format, more than a tenth of
/// the lines dropped, no row.
Table read_table(const std::string& path);

}  // namespace supertac
