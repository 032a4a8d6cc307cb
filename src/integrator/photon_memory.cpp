#include "integrator/photon_memory.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void PhotonMemory::take(uint64_t bytes) {
    if (bytes_.fetch_add(bytes, std::memory_order_relaxed) + bytes > max_bytes_)
        throw std::runtime_error(fmt::format(
            "the light vertices of a pass need more than {} MiB; render in crops (--crop) or "
            "smaller, limit max_depth, or raise the integrator's parameter \"memory\"",
            max_bytes_ >> 20));
}

uint64_t photon_memory(const IntegratorParams& p) {
    const int mebibytes = p.integer("memory");
    if (mebibytes < 1)
        throw std::runtime_error(fmt::format("{}: memory must be at least 1", p.integrator()));
    return uint64_t(mebibytes) << 20;
}

ParamInfo memory_param() {
    return {"memory", ParamKind::Int, "8192",
            "Most that the light vertices of a pass may take, in MiB."};
}

}  // namespace etendue
