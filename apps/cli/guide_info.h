#pragma once
// The part of `info` about guides: what the walks of a method learn before the first pass.

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "scene/scene.h"

namespace CLI {
class App;
}

namespace etendue {

struct GuideInfo {
    bool is_wanted = false;
    std::string shares, directions;
    std::vector<int> pixel;  ///< Empty, or column and row.

    void add_to(CLI::App& command);
    /// Throws where an option is wrong, before a scene is read.
    void check() const;
    /// Trains the guide of a method, of the scene's if `integrator` is empty; writes the images, and returns the rest as JSON.
    nlohmann::json run(const Scene& scene, const std::string& integrator, uint64_t seed,
                       int threads) const;
};

/// The result of GuideInfo::run() as text.
std::string guide_text(const nlohmann::json& guide);

}  // namespace etendue
