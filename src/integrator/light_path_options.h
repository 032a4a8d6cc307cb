#pragma once
// How many light paths a pass traces, and what they may take of memory.

#include "integrator/integrator.h"

namespace etendue {

struct LightPathOptions {
    uint64_t given;   ///< 0: one a pixel, if memory allows.
    uint64_t memory;  ///< Bytes.

    static std::vector<ParamInfo> params();
    explicit LightPathOptions(const IntegratorParams& params);

    /// N_L, where each light vertex that a pass keeps takes `vertex_bytes`; 0 where it keeps none. Of a large film, short
    /// paths tell how many fit.
    uint64_t count(const Scene& scene, const DepthOptions& depth, uint64_t vertex_bytes) const;
};

}  // namespace etendue
