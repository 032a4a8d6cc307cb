#pragma once

#include <string>
#include <vector>

#include "compare/comparison.h"

namespace etendue {

struct ReportOptions {
    std::string folder;
    std::string version;  ///< Of the program.
};

/// Writes report.html, which holds everything it shows; report.json with every figure; and in a folder a scene the images
/// (.exr and .png), error maps (.png) and convergence plots (.svg).
void write_report(const std::vector<Comparison>& comparisons, const ReportOptions& options);

/// `text` as part of a file name: letters, digits and "._=-" stay.
std::string file_stem(const std::string& text);

}  // namespace etendue
