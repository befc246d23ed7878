#include "apps/web/chart.h"

#include <algorithm>
#include <cmath>

#include "apps/web/result_page.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kWidth = 620, kHeight = 270, kLeft = 62, kRight = 14, kTop = 44, kBottom = 40;
constexpr double kRoom = 0.04;  // of the axis, on either side of the data
constexpr const char* kColours[] = {"var(--accent)", "var(--second)", "var(--third)", "var(--fourth)"};

using Points = std::vector<std::pair<double, double>>;

/// Where a value lies on an axis, 0 to 1.
class Scale {
 public:
  Scale(const ChartAxis& axis, double low, double high) : logarithmic_(axis.logarithmic) {
    low_ = of(low), high_ = of(high);
    const double room =
        high_ > low_ ? kRoom * (high_ - low_) : std::max(logarithmic_ ? 0.1 : 1e-6, 0.1 * std::abs(low_));
    low_ -= room;
    high_ = std::min(high_ + room, logarithmic_ ? 700 : axis.most);
    if (low_ >= high_) high_ = low_ + 1;
  }
  double operator()(double value) const { return (of(value) - low_) / (high_ - low_); }
  std::vector<double> numbers() const {
    return round_numbers(logarithmic_ ? std::pow(10, low_) : low_, logarithmic_ ? std::pow(10, high_) : high_,
                         logarithmic_);
  }

 private:
  double of(double value) const { return logarithmic_ ? std::log10(value) : value; }
  bool logarithmic_;
  double low_, high_;
};

std::string text(double x, double y, const char* anchor, const std::string& words,
                 const std::string& more = "") {
  return "<text x=\"" + format(x, 1) + "\" y=\"" + format(y, 1) + "\" text-anchor=\"" + anchor + "\"" + more +
         ">" + escaped(words) + "</text>";
}

std::string path(double x, double y, const char* way) {
  return "<path d=\"M" + format(x, 1) + " " + format(y, 1) + way + "\" stroke=\"var(--line)\"/>";
}

Points shown(const ChartAxis& x, const ChartAxis& y, const Points& points) {
  const auto fits = [](double v, const ChartAxis& axis) {
    return std::isfinite(v) && (v > 0 || !axis.logarithmic);
  };
  Points some;
  for (const auto& [a, b] : points)
    if (fits(a, x) && fits(b, y)) some.emplace_back(a, b);
  return some;
}

std::string axes(const ChartAxis& x, const ChartAxis& y, const Scale& across, const Scale& up) {
  const double width = kWidth - kLeft - kRight, height = kHeight - kTop - kBottom, bottom = kHeight - kBottom;
  std::string svg;
  for (const double v : up.numbers()) {
    const double at = bottom - height * up(v);
    svg += path(kLeft, at, ("h" + format(width, 1)).c_str()) + text(kLeft - 6, at + 4, "end", format(v));
  }
  for (const double v : across.numbers()) {
    const double at = kLeft + width * across(v);
    svg += path(at, bottom, "v4") + text(at, bottom + 16, "middle", format(v));
  }
  return svg + path(kLeft, bottom, ("h" + format(width, 1)).c_str()) +
         text(kLeft + width / 2, kHeight - 6, "middle", x.label) +
         text(0, 0, "middle", y.label,
              " transform=\"translate(12 " + format(kTop + height / 2, 1) + ") rotate(-90)\"");
}

}  // namespace

std::vector<double> round_numbers(double low, double high, bool logarithmic) {
  std::vector<double> numbers;
  if (logarithmic) {
    const double decades = std::log10(high / low);
    const double every = std::max(1.0, std::ceil(decades / 7));
    for (double e = std::floor(std::log10(low)); e <= std::log10(high) + 1e-9; e += every)
      for (const double digit : {1.0, 2.0, 5.0})
        if (const double v = decimal(digit, e);
            (digit == 1 || decades <= 2.5) && v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9))
          numbers.push_back(v);
    if (numbers.size() >= 2) return numbers;
    numbers.clear();
  }
  const double rough = (high - low) / 6, exponent = std::floor(std::log10(rough));
  const double share = rough / std::pow(10, exponent), digit = share <= 1   ? 1
                                                               : share <= 2 ? 2
                                                               : share <= 5 ? 5
                                                                            : 10;
  const double step = digit * std::pow(10, exponent);
  for (double n = std::ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; ++n)
    numbers.push_back(decimal(n * digit, exponent) + 0.0);  // not -0
  return numbers;
}

std::string chart_svg(const std::string& title, const ChartAxis& x, const ChartAxis& y,
                      const std::vector<ChartSeries>& series) {
  Points all;
  for (const ChartSeries& s : series) {
    const Points some = shown(x, y, s.points);
    all.insert(all.end(), some.begin(), some.end());
  }
  if (all.empty()) return {};
  const auto [left, right] = std::minmax_element(all.begin(), all.end());
  const auto [low, high] =
      std::minmax_element(all.begin(), all.end(), [](auto a, auto b) { return a.second < b.second; });
  const Scale across(x, left->first, right->first), up(y, low->second, high->second);
  std::string svg = "<svg viewBox=\"0 0 " + format(kWidth) + " " + format(kHeight) +
                    "\" role=\"img\" aria-label=\"" + escaped(title) + "\">" +
                    text(kLeft, 13, "start", title, " class=\"title\"") + axes(x, y, across, up);
  double legend = kLeft;
  const auto place = [&](const std::pair<double, double>& point) {
    return std::pair(kLeft + (kWidth - kLeft - kRight) * across(point.first),
                     kHeight - kBottom - (kHeight - kTop - kBottom) * up(point.second));
  };
  for (std::size_t i = 0; i < series.size(); ++i) {
    const ChartSeries& s = series[i];
    const std::string colour = kColours[i % std::size(kColours)];
    std::string line, marks;
    for (std::size_t k = 0; k < s.points.size(); ++k) {
      if (shown(x, y, {s.points[k]}).empty()) continue;
      const auto [px, py] = place(s.points[k]);
      line += format(px, 1) + "," + format(py, 1) + " ";
      if (s.dots)
        marks += "<circle cx=\"" + format(px, 1) + "\" cy=\"" + format(py, 1) + "\" r=\"3.5\" fill=\"" +
                 colour + "\"/>";
    }
    svg += "<polyline fill=\"none\" stroke-width=\"1.8\" stroke=\"" + colour + "\" points=\"" + line + "\"/>";
    svg += marks;
    if (series.size() == 1) continue;
    svg += "<rect x=\"" + format(legend, 1) + "\" y=\"22\" width=\"14\" height=\"4\" fill=\"" + colour +
           "\"/>" + text(legend + 19, 28, "start", s.name);
    legend += 34 + 7 * static_cast<double>(s.name.size());
  }
  return svg + "</svg>\n";
}

}  // namespace supertac
