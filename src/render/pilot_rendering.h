#pragma once
// Pilots: what `auto` renders of one candidate on a small film.

#include <atomic>
#include <utility>

#include "render/pilot_score.h"
#include "render/renderer.h"

namespace etendue {

/// Independent renderings of a candidate on each film, and the passes of each.
constexpr int kPilotReplicates = 3, kPilotPasses = 4;

/// What pilots of one candidate on one film have shown.
struct MethodPilot {
    PilotImages images;
    int passes_per_image = 1;
    double pass_seconds = 0;   ///< Simulated.
    double start_seconds = 0;  ///< Simulated, of what was made once.
    double all_seconds = 0;    ///< Simulated, of all of it.

    /// Of an image of the pilot, without the predictions for other films.
    double image_noise(double noise) const { return noise * images.horizon; }
};

/// Size of a film of pilots: of the shape of the whole one, but with so many pixels.
std::pair<int, int> size_of_pilot(const FilmGeometry& film, double pixels);

/// Renders a small film kPilotReplicates times by a method and with options of `settings`, whose limits do not count. `first`:
/// number of the first of these renderings among those of a choice. Their random numbers are not those of a rendering with
/// the same seed, nor of each other. Throws PassDropped if `drop` is set.
MethodPilot render_pilot(const Scene& small, const RenderSettings& settings, uint64_t first,
                         const std::atomic<bool>& drop);

}  // namespace etendue
