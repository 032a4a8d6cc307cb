#include "compare/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace etendue {
namespace {

constexpr double kWidth = 640, kHeight = 400;
constexpr double kLeft = 76, kRight = 20, kTop = 34, kBottom = 52;
constexpr const char* kColours[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                    "#e69f00", "#56b4e9", "#000000"};

std::string escape(const std::string& text) {
    std::string out;
    for (char c : text) {
        if (c == '&')
            out += "&amp;";
        else if (c == '<')
            out += "&lt;";
        else if (c == '>')
            out += "&gt;";
        else
            out += c;
    }
    return out;
}

/// Visible range of one axis, as decimal logarithms, and its position on the page.
struct Axis {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    double from = 0, to = 0;

    void include(double value) {
        low = std::min(low, std::log10(value));
        high = std::max(high, std::log10(value));
    }
    void finish(double page_from, double page_to) {
        from = page_from;
        to = page_to;
        if (!(low <= high)) low = -1, high = 0;
        const double margin = std::max(0.04 * (high - low), 0.02);
        low -= margin;
        high += margin;
    }
    double place(double value) const {
        return from + (to - from) * (std::log10(value) - low) / (high - low);
    }
    bool shows(double value) const { return std::log10(value) >= low && std::log10(value) <= high; }
    /// Powers of ten, and multiples of them where the range is small.
    std::vector<double> ticks() const {
        const std::vector<double> multiples =
            high - low > 3     ? std::vector<double>{1}
            : high - low > 1.2 ? std::vector<double>{1, 2, 5}
                               : std::vector<double>{1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9};
        std::vector<double> out;
        for (int decade = int(std::floor(low)); decade <= int(std::ceil(high)); ++decade)
            for (double m : multiples)
                if (const double v = m * std::pow(10, decade); shows(v)) out.push_back(v);
        return out;
    }
};

void draw_axes(std::string& out, const LogLogPlot& plot, const Axis& x, const Axis& y) {
    for (double v : x.ticks())
        out +=
            fmt::format("<path class=\"grid\" d=\"M{0:.1f} {1:.1f}V{2:.1f}\"/>"
                        "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4:g}</text>\n",
                        x.place(v), y.from, y.to, y.from + 18, v);
    for (double v : y.ticks())
        out += fmt::format("<path class=\"grid\" d=\"M{1:.1f} {0:.1f}H{2:.1f}\"/>"
                           "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n",
                           y.place(v), x.from, x.to, x.from - 6, y.place(v) + 4, v);
    out += fmt::format("<path class=\"frame\" d=\"M{0:.1f} {1:.1f}H{2:.1f}V{3:.1f}H{0:.1f}Z\"/>\n",
                       x.from, y.from, x.to, y.to);
    const double middle_x = (x.from + x.to) / 2, middle_y = (y.from + y.to) / 2;
    out += fmt::format(
        "<text class=\"title\" x=\"{:.1f}\" y=\"20\" text-anchor=\"middle\">{}</text>\n", middle_x,
        escape(plot.title));
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                       middle_x, kHeight - 12, escape(plot.x_label));
    out += fmt::format("<text transform=\"translate(16 {:.1f}) rotate(-90)\" "
                       "text-anchor=\"middle\">{}</text>\n",
                       middle_y, escape(plot.y_label));
}

void draw_curve(std::string& out, const PlotCurve& curve, const char* colour, const Axis& x,
                const Axis& y) {
    std::string path, dots;
    double first = 0, last = 0;
    for (const auto& p : curve.points) {
        if (!(p.x > 0) || !(p.y > 0)) continue;
        if (path.empty()) first = p.x;
        last = p.x;
        path +=
            fmt::format("{}{:.1f} {:.1f}", path.empty() ? 'M' : 'L', x.place(p.x), y.place(p.y));
        dots += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\">"
                            "<title>{}: {:.4g} at {:.4g}</title></circle>\n",
                            x.place(p.x), y.place(p.y), colour, escape(curve.label), p.y, p.x);
    }
    if (path.empty()) return;
    out += fmt::format("<path fill=\"none\" stroke=\"{}\" stroke-width=\"2\" d=\"{}\"/>\n", colour,
                       path);
    out += dots;
    if (!curve.law) return;
    const auto at = [&](double t) { return curve.law->factor * std::pow(t, curve.law->slope); };
    out +=
        fmt::format("<path fill=\"none\" stroke=\"{}\" stroke-dasharray=\"5 4\" "
                    "d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n",
                    colour, x.place(first), y.place(at(first)), x.place(last), y.place(at(last)));
}

}  // namespace

std::string LogLogPlot::svg() const {
    Axis x, y;
    for (const PlotCurve& c : curves)
        for (const auto& p : c.points)
            if (p.x > 0 && p.y > 0) {
                x.include(p.x);
                y.include(p.y);
            }
    x.finish(kLeft, kWidth - kRight);
    y.finish(kHeight - kBottom, kTop);

    std::string out = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
        "height=\"{1}\" font-family=\"sans-serif\" font-size=\"12\">\n"
        "<style>.grid{{stroke:#ddd}}.frame{{fill:none;stroke:#444}}.title{{font-size:14px}}</"
        "style>\n"
        "<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
        "<clipPath id=\"area\"><rect x=\"{2}\" y=\"{3}\" width=\"{4}\" "
        "height=\"{5}\"/></clipPath>\n",
        kWidth, kHeight, kLeft, kTop, kWidth - kLeft - kRight, kHeight - kTop - kBottom);
    draw_axes(out, *this, x, y);
    out += "<g clip-path=\"url(#area)\">\n";
    for (size_t i = 0; i < curves.size(); ++i)
        draw_curve(out, curves[i], kColours[i % std::size(kColours)], x, y);
    out += "</g>\n";
    // The legend is in the lower left corner, since errors decrease from left to right.
    for (size_t i = 0; i < curves.size(); ++i) {
        const double row = y.from - 12 - 18 * double(curves.size() - 1 - i);
        const std::string slope =
            curves[i].law ? fmt::format(", slope {:.2f}", curves[i].law->slope) : "";
        out += fmt::format("<path stroke=\"{}\" stroke-width=\"2\" d=\"M{} {:.1f}h22\"/>"
                           "<text x=\"{}\" y=\"{:.1f}\">{}{}</text>\n",
                           kColours[i % std::size(kColours)], kLeft + 12, row - 4, kLeft + 40, row,
                           escape(curves[i].label), slope);
    }
    return out + "</svg>\n";
}

}  // namespace etendue
