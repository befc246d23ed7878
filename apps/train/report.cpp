#include "apps/train/report.h"

#include <algorithm>
#include <cmath>

#include "apps/train/run_folder.h"
#include "io/numbers.h"

namespace supertac {
namespace {

constexpr double kWidth = 560, kHeight = 220, kLeft = 60, kBottom = 30, kTop = 12;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '<' ? "&lt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

struct Point {
  double x, y;
};

struct Curve {
  const char* title;
  std::optional<double> (*value)(const LogLine&);
  bool logarithmic;
};
constexpr Curve kCurves[] = {
    {"loss", [](const LogLine& l) { return std::optional(l.total); }, true},
    {"mean squared error of the pictures", [](const LogLine& l) { return std::optional(l.l2); }, true},
    {"SSIM of the training pictures", [](const LogLine& l) { return std::optional(l.ssim); }, false},
    {"SSIM of test pictures in contact", [](const LogLine& l) { return l.test_ssim; }, false},
    {"reconstruction error of the VAEs", [](const LogLine& l) { return std::optional(l.reconstruction); },
     true},
    {"Kullback-Leibler divergence", [](const LogLine& l) { return std::optional(l.kld); }, false},
    {"gradient norm before clipping", [](const LogLine& l) { return std::optional(l.gradient_norm); }, true}};

// A logarithmic curve has positive points only.
std::vector<Point> points_of(const std::vector<LogLine>& lines, const Curve& curve) {
  std::vector<Point> points;
  for (const LogLine& line : lines) {
    const std::optional<double> y = curve.value(line);
    if (y && std::isfinite(*y) && (!curve.logarithmic || *y > 0))
      points.push_back({static_cast<double>(line.step), *y});
  }
  return points;
}

std::string label(double x, double y, const char* anchor, const std::string& text) {
  return "<text x=\"" + format(x, 1) + "\" y=\"" + format(y, 1) + "\" text-anchor=\"" + anchor + "\">" +
         text + "</text>";
}

// A curve with its smallest and largest value on the axes.
std::string drawn(const Curve& curve, const std::vector<Point>& points) {
  if (points.empty()) return {};
  const auto [low, high] =
      std::minmax_element(points.begin(), points.end(), [](Point a, Point b) { return a.y < b.y; });
  const double bottom = low->y, top = high->y, last = std::max(points.back().x, 1.0);
  const auto scaled = [&](double y) {
    const double span = curve.logarithmic ? std::log(top / bottom) : top - bottom;
    return span <= 0 ? 0.5 : (curve.logarithmic ? std::log(y / bottom) : y - bottom) / span;
  };
  std::string path;
  for (const Point p : points) {
    path += format(kLeft + (kWidth - kLeft - 10) * p.x / last, 1) + "," +
            format(kHeight - kBottom - (kHeight - kBottom - kTop) * scaled(p.y), 1) + " ";
  }
  return std::string("<h2>") + curve.title + (curve.logarithmic ? " (logarithmic)" : "") +
         "</h2><svg viewBox=\"0 0 " + format(kWidth, 0) + " " + format(kHeight, 0) + "\">" +
         "<rect x=\"60\" y=\"12\" width=\"490\" height=\"178\" fill=\"none\" stroke=\"#999\"/>" +
         label(kLeft - 5, kTop + 8, "end", format(top, 4)) +
         label(kLeft - 5, kHeight - kBottom, "end", format(bottom, 4)) +
         label(kLeft, kHeight - 12, "start", "0") +
         label(kWidth - 10, kHeight - 12, "end", "step " + format(last, 0)) +
         "<polyline fill=\"none\" stroke=\"#0a6\" stroke-width=\"1.5\" points=\"" + path + "\"/></svg>\n";
}

}  // namespace

std::string report_page(const nlohmann::ordered_json& settings, const std::vector<LogLine>& lines) {
  std::string page =
      "<!doctype html><html><head><meta charset=\"utf-8\"><title>SuperTac training</title><style>"
      "body{font:15px sans-serif;max-width:620px;margin:2em "
      "auto}svg{width:100%}text{font-size:11px;fill:#555}"
      "pre{background:#f4f4f4;padding:1em;white-space:pre-wrap}h2{font-size:1em;margin-bottom:0}</style></"
      "head><body>"
      "<h1>SuperTac training</h1>";
  for (const Curve& curve : kCurves) page += drawn(curve, points_of(lines, curve));
  return page + "<h2>settings</h2><pre>" + escaped(settings.dump(2)) + "</pre></body></html>\n";
}

}  // namespace supertac
