#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "compare/comparison.h"

namespace etendue {

struct ReportOptions {
    std::string folder;
    std::string version;  ///< Of the program.
};

/// Writes report.html, which needs no other file; report.json with all results; and one folder per scene with images
/// (.exr and .png), error maps (.png) and convergence plots (.svg). Throws std::runtime_error where a file cannot be
/// written.
void write_report(const std::vector<Comparison>& comparisons, const ReportOptions& options);

/// All results of one comparison, as in report.json.
nlohmann::ordered_json to_json(const Comparison& comparison);

/// `text` as part of a file name: characters other than letters, digits and "._=-" become '_'.
std::string file_stem(const std::string& text);

}  // namespace etendue
