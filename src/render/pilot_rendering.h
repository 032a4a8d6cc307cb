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
    // Simulated seconds:
    double pass_seconds = 0;
    /// Of what passes take more than that at the beginning: of chains their start, of other methods the first pass, which
    /// knows nothing of the image.
    double start_seconds = 0;
    double pair_seconds = 0;       ///< Of the part of pass_seconds that pairs of gathers take.
    double prepared_seconds = 0;   ///< Of what the first replicate prepares for all of them.
    double all_seconds = 0;        ///< Of all of it.
    double pairs_an_eye_path = 0;  ///< Those that are found after the first pass.
    /// It would have taken more than it was allowed to. Then there are no images.
    bool is_stopped = false;

    /// Of an image of the pilot, without the predictions for other films.
    double image_noise(double noise) const { return noise * images.horizon; }
};

/// Size of a film of pilots: of the shape of the whole one, but with so many pixels.
std::pair<int, int> size_of_pilot(const FilmGeometry& film, double pixels);

/// Renders a small film kPilotReplicates times by a method and with options of `settings`, whose limits do not count. `first`:
/// number of the first of these renderings among those of a choice. Their random numbers are not those of a rendering with
/// the same seed, nor of each other. It is stopped as soon as one of them shows that all of them together would take more
/// than `most` simulated seconds. Throws PassDropped if `drop` is set.
MethodPilot render_pilot(const Scene& small, const RenderSettings& settings, uint64_t first,
                         double most, const std::atomic<bool>& drop);

}  // namespace etendue
