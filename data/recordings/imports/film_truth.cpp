#include "data/recordings/imports/film_truth.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/recordings/imports/table_import.h"
#include "io/files/file.h"

namespace supertac {
namespace {

std::vector<double> loads_of(const Recording& recording) {
  std::vector<double> loads(recording.frames());
  const std::size_t signals = recording.array.signals();
  const auto axes = static_cast<std::size_t>(recording.array.channels);  // the last one is the load
  for (std::size_t i = axes - 1; i < recording.signals.size(); i += axes)
    loads[i / signals] +=
        (recording.signal_scale.rest - double{recording.signals[i]}) / recording.signal_scale.span;
  return loads;
}

std::vector<double> truth_loads_of(const Recording& recording) {
  std::vector<double> loads(recording.frames());
  const std::size_t pixels = recording.truth.size() / std::max<std::size_t>(1, loads.size());
  for (std::size_t i = 0; i < recording.truth.size(); ++i) loads[i / pixels] += double{recording.truth[i]};
  return loads;
}

template <class Value>
void keep_only(std::vector<Value>& values, std::size_t each, const std::vector<std::size_t>& frames) {
  if (values.empty()) return;
  for (std::size_t i = 0; i < frames.size(); ++i)
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(frames[i] * each), each,
                values.begin() + static_cast<std::ptrdiff_t>(i * each));
  values.resize(frames.size() * each);
}

void check_times(const std::string& path, std::span<const double> times) {
  for (std::size_t r = 0; r < times.size(); ++r)
    if (!std::isfinite(times[r]) || (r > 0 && times[r] <= times[r - 1]))
      throw FileError(path, "has times that do not increase, in row " + std::to_string(r));
}

// Each frame's truth from the images before and after it; frames that the film did not see are left out.
void show(const Recording& film, const FilmClock& clock, Recording& recording) {
  const std::size_t pixels = film.truth.size() / std::max<std::size_t>(1, film.frames());
  std::vector<std::size_t> seen;
  recording.truth.clear();
  recording.truth_height = film.truth_height, recording.truth_width = film.truth_width;
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    const double t = (recording.time_s[i] - clock.offset_s) / clock.rate;
    const auto after = std::ranges::upper_bound(film.time_s, t);
    if (after == film.time_s.begin() || after == film.time_s.end()) continue;
    seen.push_back(i);
    const auto k = static_cast<std::size_t>(after - film.time_s.begin()) - 1;
    const auto share = static_cast<float>((t - film.time_s[k]) / (film.time_s[k + 1] - film.time_s[k]));
    for (std::size_t p = 0; p < pixels; ++p)
      recording.truth.push_back(
          std::lerp(film.truth[k * pixels + p], film.truth[(k + 1) * pixels + p], share));
  }
  keep_only(recording.signals, recording.array.signals(), seen);
  keep_only(recording.position_mm, 2, seen);
  keep_only(recording.lift_mm, 1, seen);
  keep_only(recording.time_s, 1, seen);
  recording.metadata["truth_clock"] = clock.text();
}

}  // namespace

std::vector<double> take_film_times(const std::string& path, Table& film, const TaxelArray& array) {
  const std::size_t pixels = film.columns - 1;
  for (const int scale : {2, 4, 8, 16}) {
    if (pixels != static_cast<std::size_t>(array.taxels() * scale * scale)) continue;
    const bool named = std::ranges::find(film.names, "time") != film.names.end();
    const std::size_t column = named ? film.column("time") : 0;
    std::vector<double> times, values;
    for (std::size_t r = 0; r < film.rows(); ++r) {
      const auto row = film.row(r);
      times.push_back(row[column]);
      for (std::size_t c = 0; c < row.size(); ++c)
        if (c != column) values.push_back(row[c]);
    }
    check_times(path, times);
    film.values = std::move(values), film.columns = pixels;
    film.shape = {static_cast<std::size_t>(array.rows * scale),
                  static_cast<std::size_t>(array.columns * scale)};
    return times;
  }
  throw FileError(path,
                  "has " + std::to_string(film.columns) +
                      " columns, expected a time and the pixels of an image 2, 4, 8 or 16 times as fine as " +
                      array.text());
}

std::vector<double> film_times(const std::string& path, const Table& times, const Table& images) {
  const bool named = std::ranges::find(times.names, "time") != times.names.end();
  if (!named && times.columns != 1)
    throw FileError(
        path, "has " + std::to_string(times.columns) + " columns, expected one of times, or a name: time");
  std::vector<double> film_s;
  for (std::size_t r = 0; r < times.rows(); ++r)
    film_s.push_back(times.row(r)[named ? times.column("time") : 0]);
  check_times(path, film_s);
  if (film_s.size() != images.rows())
    throw FileError(path, "holds " + std::to_string(film_s.size()) + " times, expected one for each of " +
                              std::to_string(images.rows()) + " images");
  return film_s;
}

FilmClock add_film(Recording& recording, const std::string& path, const Table& images,
                   const std::vector<double>& film_s, double low, double high) {
  Recording film;
  film.time_s = film_s;
  add_truth(film, path, images, low, high);
  try {
    const FilmClock clock =
        find_film_clock({recording.time_s, loads_of(recording)}, {film_s, truth_loads_of(film)});
    show(film, clock, recording);
    return clock;
  } catch (const std::runtime_error& error) {
    throw FileError(path, error.what());
  }
}

std::optional<FilmClock> clock_of_truth(const Recording& recording, std::span<const double> time_s) {
  try {
    return find_film_clock({time_s, loads_of(recording)}, {time_s, truth_loads_of(recording)});
  } catch (const std::runtime_error&) {
    return std::nullopt;  // too few touches, or none that agree: nothing is known
  }
}

std::optional<FilmClock> put_in_time(Recording& recording) {
  const auto clock = clock_of_truth(recording, recording.time_s);
  if (!clock) return std::nullopt;
  const double middle = (recording.time_s.front() + recording.time_s.back()) / 2;
  if (std::abs(middle - clock->sensor_s(middle)) <= std::max(0.02, 4 * clock->offset_deviation_s))
    return std::nullopt;
  Recording film;
  film.time_s = recording.time_s, film.truth = std::move(recording.truth);
  film.truth_height = recording.truth_height, film.truth_width = recording.truth_width;
  show(film, *clock, recording);
  return clock;
}

}  // namespace supertac
