#pragma once
// The part of `info` about `auto`: what it would choose, without rendering.

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "render/render_request.h"

namespace CLI {
class App;
}

namespace etendue {

struct ChoiceInfo {
    bool is_wanted = false;
    RenderLimits limits;

    void add_to(CLI::App& command);
    /// Throws UsageError if `integrator` is neither empty nor `auto`, perhaps with parameters.
    void check(const std::string& integrator) const;
    /// What `auto` chooses, as in --stats.
    nlohmann::json run(const Scene& scene, const std::string& integrator, uint64_t seed,
                       int threads) const;
};

/// The result of ChoiceInfo::run() as text.
std::string choice_text(const nlohmann::json& choice);

}  // namespace etendue
