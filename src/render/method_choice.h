#pragma once
// `auto` and `guide=auto`: pilots on a small film choose the method of a rendering, or whether its walks are guided. See
// docs/integrators/auto.md.

#include <atomic>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "render/renderer.h"

namespace etendue {

/// What was chosen, and why. Simulated seconds are those of cost_table.h.
struct MethodChoice {
    std::string asked;   ///< The integrator that was asked for; `auto` has all its parameters.
    std::string chosen;  ///< The integrator that renders.
    struct Candidate {
        std::string method;
        /// Of the last pilot, on a film of so many pixels; 0: there was none.
        int pixels = 0, images = 0;
        double sample_seconds = 0;      ///< Simulated, of a sample of a pixel.
        double start_seconds = 0;       ///< Simulated, before the first pass of the rendering.
        double noise = 0, missing = 0;  ///< Parts of the predicted error, see pilot_score.h.

        double error() const { return noise + missing; }
    };
    /// The one that renders first; then those with the largest pilots, and among them the best.
    std::vector<Candidate> candidates;
    double budget = 0;   ///< Simulated seconds of the rendering.
    double pilots = 0;   ///< Simulated seconds of the pilots.
    double seconds = 0;  ///< Elapsed time of the pilots.

    /// One line for the log.
    std::string message() const;
    nlohmann::ordered_json to_json() const;
    /// The same as one line of text; names of files that are not UTF-8 have marks in it, see as_utf8().
    std::string to_text() const;
    /// From the text of to_json(); throws std::runtime_error if it is none.
    static MethodChoice from_json(const std::string& text);
};

inline const std::atomic<bool> kNeverDrop{false};

/// Whether it is `auto`, or a method with `guide=auto`.
bool is_chosen_by_pilots(const IntegratorSpec& spec);

/// The same settings. If pilots choose their integrator, it is replaced by what they choose, and `choice` is set.
///
/// The method is a function of the scene, the seed, the limits and the other settings that decide the image, but not of
/// the number of threads, the first pass, or any clock. Where several processes render together, chains are no candidates;
/// else their number does not matter. The pilots have random numbers of their own: passes do not depend on them. Throws
/// PassDropped once `drop` is set.
RenderSettings with_chosen_method(const Scene& scene, const RenderSettings& settings,
                                  const std::atomic<bool>& drop = kNeverDrop);
/// The same where an earlier rendering has chosen already. Throws std::runtime_error if it was asked for something else.
RenderSettings with_chosen_method(const RenderSettings& settings, const MethodChoice& earlier);

}  // namespace etendue
