#include <algorithm>
#include <cmath>

#include "data/simulation/fit.h"

namespace supertac {
namespace {

constexpr double kTouch = 0.08;  // of the range: a frame whose strongest taxel shows more is touched
constexpr double kCut = 0.995;   // one that shows more is cut off at the end of the range
constexpr std::size_t kLeastFrames = 100;

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + at);
  return values[static_cast<std::size_t>(at)];
}

// Loads [frames][taxels] as shares of the range, of three axes the last, above each taxel's own rest.
struct Loads {
  TaxelArray array;
  std::size_t taxels = 0, frames = 0;
  double period_s = 0;
  std::vector<double> share;

  explicit Loads(const Recording& r)
      : array(r.array),
        taxels(static_cast<std::size_t>(r.array.taxels())),
        frames(r.frames()),
        period_s(r.period_s()),
        share(frames * taxels) {
    const auto channels = static_cast<std::size_t>(array.channels);
    for (std::size_t k = 0; k < taxels; ++k) {
      std::vector<double> own;
      for (std::size_t f = 0; f < frames; ++f)
        own.push_back((r.signal_scale.rest - double{r.signals[(f * taxels + k) * channels + channels - 1]}) /
                      r.signal_scale.span);
      const double rest = quantile(own, 0.3);
      for (std::size_t f = 0; f < frames; ++f) share[f * taxels + k] = own[f] - rest;
    }
  }
  double at(std::size_t frame, int row, int column) const {
    return share[frame * taxels + static_cast<std::size_t>(row * array.columns + column)];
  }
};

// Of a frame: its strongest taxel and that one's neighbours, the means of its row, its column and all else
// that lie far from it, and the largest first and second differences between neighbours anywhere; as shares
// of the peak.
struct Peak {
  int taxel;
  double height, near, two_away, far_row, far_column, far, step, bend;
};

Peak peak_of(const Loads& loads, std::size_t frame) {
  const int rows = loads.array.rows, columns = loads.array.columns;
  const auto first = loads.share.begin() + static_cast<std::ptrdiff_t>(frame * loads.taxels);
  const auto most = std::max_element(first, first + static_cast<std::ptrdiff_t>(loads.taxels));
  const int k = static_cast<int>(most - first), row = k / columns, column = k % columns;
  Peak peak{};
  peak.taxel = k, peak.height = *most;
  if (!(*most > 0)) return peak;
  const auto mean = [&](auto belongs) {
    double sum = 0;
    int count = 0;
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c)
        if (belongs(std::abs(r - row), std::abs(c - column))) sum += loads.at(frame, r, c), ++count;
    return count > 0 ? sum / count / *most : 0;
  };
  peak.near = mean([](int r, int c) { return r + c == 1; });
  peak.two_away = mean([](int r, int c) { return (r == 0 && c == 2) || (r == 2 && c == 0); });
  peak.far_row = mean([](int r, int c) { return r == 0 && c > 2; });
  peak.far_column = mean([](int r, int c) { return r > 2 && c == 0; });
  peak.far = mean([](int r, int c) { return r > 2 && c > 2; });
  const auto differ = [&](int r, int c, int dr, int dc) {
    if (r + dr >= rows || c + dc >= columns) return;
    const double here = loads.at(frame, r, c), next = loads.at(frame, r + dr, c + dc);
    peak.step = std::max(peak.step, std::abs(here - next) / *most);
    if (r >= dr && c >= dc)
      peak.bend = std::max(peak.bend, (2 * here - next - loads.at(frame, r - dr, c - dc)) / *most);
  };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) differ(r, c, 0, 1), differ(r, c, 1, 0);
  return peak;
}

// Of each touch: how long the total takes to rise and to fall, how it grows while it is held, what is left of
// it after it, and how much wider its peak is when it is heavy than when it was light.
struct Course {
  std::vector<double> rise_s, fall_s, tail_s, growth, early, late, wider;
};

Course course_of(const Loads& loads, const std::vector<double>& total, const std::vector<Peak>& peaks) {
  Course course;
  const auto touched = [&](std::size_t f) { return peaks[f].height > kTouch; };
  const auto frames_of = [&](double s) { return static_cast<std::size_t>(s / loads.period_s) + 1; };
  for (std::size_t first = 1, end = 0; first < loads.frames; first = std::max(end, first + 1)) {
    if (!touched(first) || touched(first - 1)) continue;
    for (end = first; end < loads.frames && touched(end);) ++end;
    if (end - first < 4 || first < frames_of(0.1) || end + frames_of(0.5) >= loads.frames) continue;
    const auto strongest = std::max_element(total.begin() + static_cast<std::ptrdiff_t>(first),
                                            total.begin() + static_cast<std::ptrdiff_t>(end));
    const auto top = static_cast<std::size_t>(strongest - total.begin());
    const auto crossing = [&](double share, int step) {
      std::size_t i = top;
      while (i > 0 && i + 1 < loads.frames && total[i] > share * *strongest) i = step < 0 ? i - 1 : i + 1;
      const double here = total[i], inside = total[step < 0 ? i + 1 : i - 1];
      const double back = std::clamp((share * *strongest - here) / std::max(1e-9, inside - here), 0.0, 1.0);
      return (static_cast<double>(i) - step * back) * loads.period_s;
    };
    const double up_80 = crossing(0.8, -1), down_80 = crossing(0.8, 1), down_30 = crossing(0.3, 1);
    course.rise_s.push_back(up_80 - crossing(0.2, -1));
    course.fall_s.push_back(down_30 - down_80);
    course.tail_s.push_back(crossing(0.06, 1) - down_30);
    const auto at = [&](double s) {
      return total[std::min(loads.frames - 1, static_cast<std::size_t>(s / loads.period_s))];
    };
    course.early.push_back(at(down_30 + 0.2) / *strongest),
        course.late.push_back(at(down_30 + 0.45) / *strongest);
    if (const double hold = down_80 - up_80; hold > 0.4)
      course.growth.push_back((at(down_80 - 0.1) / std::max(1e-9, at(up_80 + 0.1)) - 1) / hold);
    // Where the response saturates, a peak grows less than the taxels around it.
    if (peaks[top].height < 0.3 || peaks[top].height > kCut) continue;
    const auto light = std::find_if(
        peaks.begin() + static_cast<std::ptrdiff_t>(first), peaks.begin() + static_cast<std::ptrdiff_t>(top),
        [&](const Peak& p) { return p.height > 0.25 * peaks[top].height && p.taxel == peaks[top].taxel; });
    const double grew = peaks[top].height / light->height;
    if (grew > 1.5 && peaks[top].near > 0.05 && light->near > 0.02)
      course.wider.push_back(std::log(peaks[top].near / light->near) / std::log(grew));
  }
  return course;
}

}  // namespace

std::vector<double> touch_statistics(const Recording& recording) {
  const Loads loads(recording);
  std::vector<double> total(loads.frames);
  std::vector<Peak> peaks, touches;
  for (std::size_t f = 0; f < loads.frames; ++f) {
    for (std::size_t k = 0; k < loads.taxels; ++k) total[f] += loads.share[f * loads.taxels + k];
    peaks.push_back(peak_of(loads, f));
    if (peaks.back().height > kTouch && peaks.back().height < kCut) touches.push_back(peaks.back());
  }
  if (touches.size() < kLeastFrames) return {};
  std::vector<double> statistics;
  const auto of_peaks = [&](std::initializer_list<double> shares, auto value) {
    std::vector<double> values;
    for (const Peak& peak : touches) values.push_back(value(peak));
    for (const double share : shares) statistics.push_back(quantile(values, share));
  };
  of_peaks({0.03, 0.15, 0.5}, [](const Peak& p) { return p.near - p.far; });
  of_peaks({0.1, 0.4}, [](const Peak& p) { return p.two_away - p.far; });
  of_peaks({0.5, 0.8, 0.97}, [](const Peak& p) { return p.step; });
  of_peaks({0.5, 0.8, 0.97}, [](const Peak& p) { return p.bend; });
  of_peaks({0.3, 0.5}, [](const Peak& p) { return p.far_row - p.far; });
  of_peaks({0.3, 0.5}, [](const Peak& p) { return p.far_column - p.far; });
  of_peaks({0.5}, [](const Peak& p) { return p.far; });
  const Course course = course_of(loads, total, peaks);
  const auto log_s = [&](const std::vector<double>& s, double share) {
    statistics.push_back(std::log(std::max(0.2 * loads.period_s, quantile(s, share))));
  };
  log_s(course.rise_s, 0.5), log_s(course.fall_s, 0.2), log_s(course.fall_s, 0.5);
  log_s(course.tail_s, 0.1), log_s(course.tail_s, 0.3), log_s(course.tail_s, 0.6);
  for (const auto* values : {&course.early, &course.late, &course.growth, &course.wider})
    for (const double share : {0.25, 0.5}) statistics.push_back(quantile(*values, share));
  return statistics;
}

}  // namespace supertac
