#pragma once
// Output of a rendering: statistics as JSON, and the image with its layers and metadata.

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "image/image.h"
#include "render/aov.h"
#include "render/renderer.h"
#include "system/make_room.h"

namespace etendue {

/// Seconds and pairs of vertices of each pass.
struct PassLog {
    std::vector<double> seconds;
    std::vector<uint64_t> pairs;

    /// Appends those of other passes.
    void append(const std::vector<double>& more_seconds, const std::vector<uint64_t>& more_pairs) {
        for (const double s : more_seconds) seconds.push_back(s), seconds_before_ += s;
        for (const uint64_t p : more_pairs) pairs.push_back(p), pairs_before_ += p;
    }
    /// Appends a pass. Where there is no memory for it, the next one has its numbers, too.
    void add(double seconds_so_far, uint64_t pairs_so_far) {
        make_room(seconds), make_room(pairs);
        seconds.push_back(seconds_so_far - seconds_before_);
        pairs.push_back(pairs_so_far - pairs_before_);
        seconds_before_ = seconds_so_far;
        pairs_before_ = pairs_so_far;
    }

private:
    double seconds_before_ = 0;
    uint64_t pairs_before_ = 0;
};

/// Statistics of passes by name.
nlohmann::json statistics(const Film& film, const RenderStats& stats, double seconds,
                          const ErrorEstimate& error);

/// Statistics of a rendering by name. `stopped_by`: a StopReason, or "failure". `error`: that of the film, where it is
/// known already; it takes a while with groups.
nlohmann::json to_json(const Renderer& r, const Scene& scene, const RenderSettings& settings,
                       const std::string& stopped_by, const PassLog& log,
                       const ErrorEstimate* error = nullptr);

/// The texts and numbers of a report, with the version of the program.
ImageAttributes attributes_of(const nlohmann::json& report);
/// The image with `layers`, with a layer of its variance if `has_variance`, and with attributes_of(report). It reads the
/// film and the layers when it is written.
ImageRows image_rows(const Film& film, std::span<const AovImage> layers, bool has_variance,
                     const nlohmann::json& report);

}  // namespace etendue
