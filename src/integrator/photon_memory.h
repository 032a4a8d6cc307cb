#pragma once
// The bound of what the light paths of a pass may take.

#include <atomic>
#include <cstdint>

#include "integrator/integrator.h"

namespace etendue {

/// What all threads of a pass keep of its light paths.
class PhotonMemory {
public:
    explicit PhotonMemory(uint64_t max_bytes) : max_bytes_(max_bytes) {}
    /// Throws std::runtime_error where they have taken too much.
    void take(uint64_t bytes);

private:
    uint64_t max_bytes_;
    std::atomic<uint64_t> bytes_ = 0;
};

/// The parameter `memory`, in bytes.
uint64_t photon_memory(const IntegratorParams& p);
ParamInfo memory_param();

}  // namespace etendue
