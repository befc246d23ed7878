#include "apps/sweep/table.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::uint64_t kMaxBytes = 64 << 20;

std::string header() { return joined(sweep_columns(), ",", &SweepColumn::name); }

std::string cell(const nlohmann::ordered_json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return format(value.get<double>(), 6);
  return value.is_null() ? "nan" : value.dump();
}

}  // namespace

const std::vector<SweepColumn>& sweep_columns() {
  static const std::vector<SweepColumn> kColumns = [] {
    std::vector<SweepColumn> columns;
    for (const std::string& name : comma_list(
             "model,preset,timesteps,latent,scale,channels,rcabs,seed,split,windows,ssim,psnr_db,"
             "psnr_pooled_db,phase,phase_floor,position_px,position_mm,all_windows,all_ssim,all_psnr_db,"
             "all_psnr_pooled_db,all_phase,all_phase_floor,all_position_px,all_position_mm,median_us,p99_us,"
             "mmac,parameters,memory_mb,train_s,steps,commit"))
      columns.push_back({name, name == "model" || name == "preset" || name == "split" || name == "commit"});
    return columns;
  }();
  return kColumns;
}

SweepTable::SweepTable(std::string path) : path_(std::move(path)) { read(); }

void SweepTable::read_again() {
  rows_.clear();
  read();
}

void SweepTable::read() {
  if (!std::filesystem::exists(path_)) return;
  const std::string content = read_text_file(path_, kMaxBytes);
  std::size_t begin = 0;
  for (std::size_t number = 1; begin < content.size(); ++number) {
    const std::size_t end = content.find('\n', begin);
    if (end == std::string::npos) {
      dropped_ = true;
      return;
    }
    read_line(content.substr(begin, end - begin), number);
    begin = end + 1;
  }
}

void SweepTable::read_line(const std::string& line, std::size_t number) {
  const auto fail = [&](const std::string& what) {
    throw FileError(path_, "line " + std::to_string(number) + ": " + what +
                               "; correct or remove the line, or choose another --out");
  };
  if (number == 1) {
    if (line != header()) fail("expected the columns " + header() + ", found " + line);
    return;
  }
  Row row = comma_list(line);
  const auto& columns = sweep_columns();
  if (row.size() != columns.size()) {
    fail("expected " + std::to_string(columns.size()) + " cells, found " + std::to_string(row.size()));
  }
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (!columns[i].text && !parse_double(row[i]))
      fail(columns[i].name + " expects a number, found \"" + row[i] + "\"");
  }
  if (has(row[0])) fail("model " + row[0] + " is there twice");
  rows_.push_back(std::move(row));
}

bool SweepTable::has(const std::string& model) const {
  return std::ranges::any_of(rows_, [&](const Row& row) { return row[0] == model; });
}

void SweepTable::add(const nlohmann::ordered_json& values, const std::vector<std::string>& order) {
  Row row;
  for (const SweepColumn& column : sweep_columns()) {
    if (!values.contains(column.name))
      throw std::invalid_argument("SweepTable: no value for column " + column.name);
    row.push_back(cell(values[column.name]));
  }
  const auto place = [&](const Row& r) {
    const auto found = std::ranges::find(order, r[0]);
    return found == order.end() ? -1 : found - order.begin();
  };
  rows_.insert(std::ranges::find_if(rows_, [&](const Row& r) { return place(r) > place(row); }), row);
  std::string content = header() + "\n";
  for (const Row& r : rows_) content += joined(r) + "\n";
  write_file(path_, content);
}

}  // namespace supertac
