#pragma once
// What a checkpoint says of itself.

#include <compare>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "film/film.h"
#include "system/section_file.h"

namespace etendue {

/// Everything that decides the bits of passes, as names and values for people. With equal conditions, equal passes have
/// equal bits.
using Conditions = std::vector<std::pair<std::string, std::string>>;
constexpr const char* kIntegratorCondition = "integrator";  ///< Name of that of the method.

/// Passes first … first + passes - 1 of a seed.
struct PassRange {
    uint64_t seed = 0, first = 0, passes = 0;

    friend auto operator<=>(const PassRange&, const PassRange&) = default;
};
std::string to_string(const PassRange& range);

struct CheckpointHeader {
    std::string scene, integrator;
    std::string estimator;  ///< As to_string() gives it.
    /// In order; more than one if it is a sum.
    std::vector<PassRange> ranges;
    bool is_merged = false;
    FilmGeometry film;
    int technique_depth = 0;  ///< 0 if there are no technique images.
    Conditions conditions;
    std::string
        choice;  ///< How `auto` chose the method, as MethodChoice gives it; empty if it did not.

    uint64_t passes() const;
    /// What the conditions say of `name`; empty if there is no such condition.
    std::string condition(const std::string& name) const;
};

/// The section "rendering".
void save_header(const CheckpointHeader& header, SectionWriter& to);
/// Throws std::runtime_error if something cannot be, or cannot fit into the file.
CheckpointHeader load_header(SectionReader& from);

}  // namespace etendue
