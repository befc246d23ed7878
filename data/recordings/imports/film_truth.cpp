#include "data/recordings/imports/imports.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "io/files/file.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kCoarseS = 0.05, kFineS = 0.01;

// A course on even steps from its first time on, scaled to 0 to 1.
struct Even {
  double first_s = 0, step_s = 0;
  std::vector<double> load;

  Even(const LoadCourse& course, double step) : first_s(course.time_s.front()), step_s(step) {
    std::vector<double> sorted(course.load.begin(), course.load.end());
    const double low = quantile(sorted, 0.02), high = quantile(sorted, 0.98);
    std::size_t next = 0;
    // Of frames closer than a step the mean, else a line between those around.
    for (double t = first_s; t <= course.time_s.back(); t += step) {
      double sum = 0, count = 0;
      for (std::size_t i = next; i < course.time_s.size() && course.time_s[i] < t + step / 2; ++i)
        if (course.time_s[i] >= t - step / 2) sum += course.load[i], ++count;
      while (next + 1 < course.time_s.size() && course.time_s[next + 1] <= t) ++next;
      double value = course.load[next];
      if (count > 1) {
        value = sum / count;
      } else if (next + 1 < course.time_s.size()) {
        const double share = (t - course.time_s[next]) / (course.time_s[next + 1] - course.time_s[next]);
        value = std::lerp(course.load[next], course.load[next + 1], std::clamp(share, 0.0, 1.0));
      }
      load.push_back(high > low ? std::clamp((value - low) / (high - low), 0.0, 1.0) : 0);
    }
  }
  // Means over `width` steps around each, twice: the slope of noise is no slope. What is done to both courses
  // moves neither.
  void smooth(std::size_t width) {
    for (int twice = 0; twice < 2; ++twice) {
      std::vector<double> sums(load.size() + 1);
      for (std::size_t i = 0; i < load.size(); ++i) sums[i + 1] = sums[i] + load[i];
      for (std::size_t i = 0; i < load.size(); ++i) {
        const std::size_t half = std::min({width / 2, i, load.size() - 1 - i});
        load[i] = (sums[i + half + 1] - sums[i - half]) / static_cast<double>(2 * half + 1);
      }
    }
  }
  double time(std::size_t i) const { return first_s + step_s * static_cast<double>(i); }
  bool holds(double t) const { return t >= first_s + step_s && t <= time(load.size() - 1) - 2 * step_s; }
  double at(double t) const {
    const double place = (t - first_s) / step_s;
    const auto i = std::min(load.size() - 2, static_cast<std::size_t>(std::max(0.0, place)));
    return std::lerp(load[i], load[i + 1], place - static_cast<double>(i));
  }
  double slope(double t) const { return (at(t + step_s) - at(t - step_s)) / (2 * step_s); }
};

struct Sums {
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  void add(double x, double y) { n += 1, a += x, b += y, aa += x * x, bb += y * y, ab += x * y; }
  double correlation() const {
    const double va = aa - a * a / n, vb = bb - b * b / n;
    return n > 2 && va > 1e-9 && vb > 1e-9 ? (ab - a * b / n) / std::sqrt(va * vb) : 0;
  }
};

// Every offset, there at the film's middle, and rate.
std::vector<FilmClock> tried(const Even& sensor, const Even& film, double around_s, double middle_s) {
  std::vector<FilmClock> places;
  const double half_s = film.step_s * static_cast<double>(film.load.size()) / 2;
  const double rate_step = std::min(kMostRate, 1.5 * kCoarseS / half_s);
  for (double rate = 1 - kMostRate; rate <= 1 + kMostRate + rate_step / 2; rate += rate_step)
    for (double shift = -kFarthestS; shift <= kFarthestS; shift += kCoarseS) {
      Sums sums;
      for (std::size_t i = 0; i < film.load.size(); ++i) {
        const double t = middle_s + around_s + shift + rate * (film.time(i) - middle_s);
        if (sensor.holds(t)) sums.add(sensor.at(t), film.load[i]);
      }
      if (sums.n * film.step_s >= kFarthestS &&
          2 * sums.n >= static_cast<double>(std::min(film.load.size(), sensor.load.size())))
        places.push_back({.offset_s = around_s + shift, .rate = rate, .correlation = sums.correlation()});
    }
  return places;
}

std::size_t touches_in(const Even& course) {
  std::size_t count = 0;
  bool up = false;
  for (const double load : course.load) {
    if (!up && load > 0.5) up = true, ++count;
    if (up && load < 0.25) up = false;
  }
  return count;
}

// Least squares of film = rest + gain sensor(t) + bent sensor(t)^2, t = middle + shift + rate (film's time -
// middle).
enum Unknown { kShift, kRate, kGain, kBent, kRest, kUnknowns };
using Vector = std::array<double, kUnknowns>;
using Matrix = std::array<Vector, kUnknowns>;

// x of a x = y, a symmetric and positive definite (Gauss-Jordan).
Vector solved(Matrix a, Vector y) {
  for (std::size_t k = 0; k < kUnknowns; ++k) {
    const double pivot = 1 / (a[k][k] + 1e-9);
    for (double& v : a[k]) v *= pivot;
    y[k] *= pivot;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      if (i == k) continue;
      const double factor = a[i][k];
      for (std::size_t j = k; j < kUnknowns; ++j) a[i][j] -= factor * a[k][j];
      y[i] -= factor * y[k];
    }
  }
  return y;
}

// Its offset, too, is that at the film's middle.
FilmClock refine(const Even& sensor, const Even& film, double middle_s, const FilmClock& from) {
  Vector unknown = {from.offset_s, from.rate, 1, 0, 0};
  Matrix normal;
  struct Second {  // sums of weight residual jacobian, and of weight jacobian jacobian
    Vector score{};
    Matrix normal{};
  };
  std::vector<Second> seconds;
  std::vector<double> sizes;
  Sums sums;
  double deviation = 1;
  for (int round = 0; round < 12; ++round) {
    normal = {};
    Vector right{};
    seconds.assign(static_cast<std::size_t>(film.step_s * static_cast<double>(film.load.size())) + 1, {});
    sizes.clear(), sums = {};
    for (std::size_t i = 0; i < film.load.size(); ++i) {
      const double away = film.time(i) - middle_s, t = middle_s + unknown[kShift] + unknown[kRate] * away;
      if (!sensor.holds(t)) continue;
      const double load = sensor.at(t),
                   shown = unknown[kRest] + load * (unknown[kGain] + load * unknown[kBent]);
      const double residual = film.load[i] - shown;
      const double slope = (unknown[kGain] + 2 * load * unknown[kBent]) * sensor.slope(t);
      const Vector jacobian = {slope, slope * away, load, load * load, 1};
      const double weight = std::min(1.0, 3 * deviation / std::max(1e-12, std::abs(residual)));
      Second& second = seconds[static_cast<std::size_t>(film.time(i) - film.first_s)];
      for (std::size_t a = 0; a < kUnknowns; ++a) {
        second.score[a] += weight * jacobian[a] * residual, right[a] += weight * jacobian[a] * residual;
        for (std::size_t b = 0; b < kUnknowns; ++b) {
          second.normal[a][b] += weight * jacobian[a] * jacobian[b];
          normal[a][b] += weight * jacobian[a] * jacobian[b];
        }
      }
      sizes.push_back(std::abs(residual));
      sums.add(shown, film.load[i]);
    }
    const Vector step = solved(normal, right);
    for (std::size_t a = 0; a < kUnknowns; ++a) unknown[a] += step[a];
    if (!sizes.empty()) deviation = std::max(1e-6, normal_deviation(sizes));
  }
  // Jackknife: how far each second moves what the others say. Of a short film each of few touches has weight.
  double of_shift = 0, of_rate = 0;
  for (const Second& second : seconds) {
    Matrix others = normal;
    for (std::size_t a = 0; a < kUnknowns; ++a)
      for (std::size_t b = 0; b < kUnknowns; ++b) others[a][b] -= second.normal[a][b];
    const Vector moved = solved(others, second.score);
    of_shift += moved[kShift] * moved[kShift], of_rate += moved[kRate] * moved[kRate];
  }
  return {.offset_s = unknown[kShift],
          .rate = unknown[kRate],
          .offset_deviation_s = std::sqrt(of_shift),
          .rate_deviation = std::sqrt(of_rate),
          .correlation = sums.correlation()};
}

[[noreturn]] void refuse(const std::string& why) {
  throw std::runtime_error(
      "sensor and film do not agree on when something touched: " + why +
      "; record both while something presses and lets go several times, at uneven intervals");
}

}  // namespace

std::string FilmClock::text() const {
  return "offset " + format(offset_s, 3) + " +- " + format(offset_deviation_s, 3) + " s, rate " +
         format(rate, 5) + " +- " + format(rate_deviation, 5) + ", correlation " + format(correlation, 3);
}

FilmClock find_film_clock(const LoadCourse& sensor, const LoadCourse& film) {
  for (const LoadCourse* course : {&sensor, &film})
    if (course->time_s.size() < 10 || course->time_s.back() - course->time_s.front() < kFarthestS)
      refuse("fewer than " + format(kFarthestS) + " s were recorded");
  const Even coarse_sensor(sensor, kCoarseS), coarse_film(film, kCoarseS);
  if (touches_in(coarse_sensor) < 3 || touches_in(coarse_film) < 3) refuse("fewer than three touches");
  const double middle = (film.time_s.front() + film.time_s.back()) / 2;
  const bool overlap =
      sensor.time_s.front() < film.time_s.back() && film.time_s.front() < sensor.time_s.back();
  const double around = overlap ? 0 : sensor.time_s.front() - film.time_s.front();
  const std::vector<FilmClock> places = tried(coarse_sensor, coarse_film, around, middle);
  if (places.empty()) refuse("they have fewer than " + format(kFarthestS) + " s in common");
  const FilmClock best = *std::ranges::max_element(places, {}, &FilmClock::correlation);
  for (const FilmClock& other : places)
    if (std::abs(other.offset_s - best.offset_s) > 0.4 && other.correlation > 0.93 * best.correlation)
      refuse("offsets of " + format(best.offset_s, 2) + " and " + format(other.offset_s, 2) + " s fit alike");
  Even fine_sensor(sensor, kFineS), fine_film(film, kFineS);
  fine_sensor.smooth(11), fine_film.smooth(11);
  FilmClock fine = refine(fine_sensor, fine_film, middle, best);
  if (!(fine.correlation >= 0.8))
    refuse("their total loads have a correlation of " + format(fine.correlation, 2) +
           ", expected 0.8 or more");
  if (!(fine.offset_deviation_s <= 0.004 && fine.rate_deviation <= 4e-4))
    refuse("the offset stays uncertain by " + format(fine.offset_deviation_s, 3) + " s, the rate by " +
           format(100 * fine.rate_deviation, 3) + " %");
  if (std::abs(fine.rate - 1) > kMostRate) refuse("a rate of " + format(fine.rate, 4));
  fine.offset_s = middle + fine.offset_s - fine.rate * middle;
  return fine;
}

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

std::size_t time_column(const Table& table) {
  const auto named = std::ranges::find(table.names, "time");
  return named == table.names.end() ? 0 : static_cast<std::size_t>(named - table.names.begin());
}

std::vector<double> increasing_times(const std::string& path, const Table& table) {
  std::vector<double> times;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const double t = table.row(r)[time_column(table)];
    if (!std::isfinite(t) || (r > 0 && t <= times.back()))
      throw FileError(path, "has times that do not increase, in row " + std::to_string(r));
    times.push_back(t);
  }
  return times;
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
    std::vector<double> times = increasing_times(path, film);
    std::size_t place = 0;
    std::erase_if(film.values,
                  [&, column = time_column(film)](double) { return place++ % film.columns == column; });
    film.columns = pixels;
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
  if (times.columns != 1 && std::ranges::find(times.names, "time") == times.names.end())
    throw FileError(
        path, "has " + std::to_string(times.columns) + " columns, expected one of times, or a name: time");
  std::vector<double> film_s = increasing_times(path, times);
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
