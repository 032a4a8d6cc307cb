#pragma once

#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "compare/comparison.h"

namespace etendue {

struct ReportOptions {
    std::string folder;
    std::string version;  ///< Of the program.
};

/// Writes report.html, which needs no other file; report.json with all results; and one folder per scene with images
/// (.exr and .png), error maps (.png) and convergence plots (.svg). All functions throw std::runtime_error where a file
/// cannot be written.
class ReportWriter {
public:
    explicit ReportWriter(ReportOptions options);
    /// Writes the folder of the scene, and adds it to the report.
    void add(const Comparison& comparison);
    /// Adds a scene that could not be compared.
    void add_failure(const std::string& scene, const std::string& reason);
    /// Writes the report of what was added so far, in the place of an earlier one.
    void write() const;

private:
    ReportOptions options_;
    nlohmann::ordered_json report_, pictures_;
    std::set<std::string> names_;
};
void write_report(const std::vector<Comparison>& comparisons, const ReportOptions& options);

/// All results of one comparison, as in report.json.
nlohmann::ordered_json to_json(const Comparison& comparison);

/// `text` as part of a file name: characters other than letters, digits and "._=-" become '_'.
std::string file_stem(const std::string& text);

}  // namespace etendue
