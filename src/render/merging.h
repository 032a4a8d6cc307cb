#pragma once
// Sums of renderings.

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "render/checkpoint.h"

namespace etendue {

/// Renderings of one scene by one method, whose passes are all different.
class Merging {
public:
    /// Throws std::runtime_error if some of them do not belong together. Sorts them, so that nothing depends on their order.
    explicit Merging(std::vector<CheckpointFile> parts);

    /// Adds up the sums.
    RenderTotals totals();
    /// What more seeds cannot improve, in words.
    std::vector<std::string> warnings() const;
    /// Statistics by name, as to_json() of a rendering gives them.
    nlohmann::json report(const RenderTotals& totals) const;
    /// Writes the sums as a file that can be merged again.
    void write(const std::string& file, const RenderTotals& totals) const;
    /// The same as bytes.
    std::string bytes(const RenderTotals& totals) const;
    const CheckpointFile& first() const { return parts_.front(); }

private:
    void save(const RenderTotals& totals, SectionWriter& to) const;

    std::vector<CheckpointFile> parts_;
    std::vector<PassRange> ranges_;
};

}  // namespace etendue
