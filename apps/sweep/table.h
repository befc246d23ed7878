// sweep.csv: one row for each model of a sweep.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace supertac {

/// The columns of sweep.csv in order; `text` ones hold no number.
///   model ... seed       the model's name and settings
///   windows ... position_mm          scores of the test windows in contact (data/scores/metrics.h)
///   all_windows ... all_position_mm  of all test windows
///   median_us, p99_us    processor time of one window at batch 1 on one thread
///   mmac, parameters     millions of multiply-adds per window, values in the checkpoint
///   memory_mb            largest resident memory while the model was trained and scored, data set included
///   train_s, steps       time on the clock that training took, scores at epoch ends included
///   commit               what the program was built from
struct SweepColumn {
  std::string name;
  bool text = false;
};
const std::vector<SweepColumn>& sweep_columns();

class SweepTable {
 public:
  using Row = std::vector<std::string>;

  /// Reads the file if there is one. A last line without its end, as a killed writer of another program or a
  /// full disk may leave it, is dropped and written over by the next add().
  /// Throws FileError naming the line when anything else is wrong: other columns, a cell that is no number, a
  /// model twice.
  explicit SweepTable(std::string path);

  bool dropped_a_cut_line() const { return dropped_; }
  bool has(const std::string& model) const;
  /// What another process has added meanwhile. Throws as the constructor.
  void read_again();
  /// Adds a row, keys as sweep_columns(), and writes the file atomically: rows of models in `order` stand in
  /// that order, after all others. Throws FileError, std::invalid_argument when a column is missing.
  void add(const nlohmann::ordered_json& values, const std::vector<std::string>& order);

  /// Cells as sweep_columns(): texts, and numbers, which are NaN for a figure over no windows.
  const std::vector<Row>& rows() const { return rows_; }

 private:
  void read();
  void read_line(const std::string& line, std::size_t number);

  std::string path_;
  std::vector<Row> rows_;
  bool dropped_ = false;
};

}  // namespace supertac
