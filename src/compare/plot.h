#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/error_statistics.h"

namespace etendue {

struct PlotCurve {
    std::string label;
    /// Points with a value that is not positive are left out: a logarithm does not show them.
    struct Point {
        double x, y;
    };
    std::vector<Point> points;
    std::optional<PowerLaw> law;  ///< Drawn thin over the points, its slope in the legend.
};

/// Both axes logarithmic.
struct LogLogPlot {
    std::string title, x_label, y_label;
    std::vector<PlotCurve> curves;

    /// A complete SVG document. Colours are those of Okabe and Ito, told apart by most eyes.
    std::string svg() const;
};

}  // namespace etendue
