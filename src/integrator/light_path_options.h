#pragma once
// Number of light paths in a pass, and their memory limit.

#include "integrator/integrator.h"
#include "math/statistics.h"

namespace etendue {

struct LightPathOptions {
    uint64_t given;   ///< Parameter light_paths; 0: one light path per pixel, if memory allows.
    uint64_t memory;  ///< Memory limit in bytes.

    static std::vector<ParamInfo> params();
    explicit LightPathOptions(const IntegratorParams& params);

    /// Number of light paths N_L. `vertex_bytes` is the memory of a stored light vertex. On a large film, pilot paths
    /// determine how many light paths fit into the memory.
    uint64_t count(const Scene& scene, const DepthOptions& depth, uint64_t vertex_bytes) const;
};

/// Number of vertices of light paths, from pilot paths that no pass traces.
Moments light_path_length(const Scene& scene, const DepthOptions& depth);

}  // namespace etendue
