#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/error_statistics.h"

namespace etendue {

struct PlotCurve {
    std::string label;
    /// Points with a value that is not positive are left out, since the axes are logarithmic.
    struct Point {
        double x, y;
    };
    std::vector<Point> points;
    std::optional<PowerLaw> law;  ///< Drawn as a dashed line; the legend shows its slope.
};

/// A plot with two logarithmic axes.
struct LogLogPlot {
    std::string title, x_label, y_label;
    std::vector<PlotCurve> curves;

    /// A complete SVG document, with the colour-blind-safe palette of Okabe and Ito.
    std::string svg() const;
};

}  // namespace etendue
