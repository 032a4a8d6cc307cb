#pragma once

#include <string>

#include "session/session.h"

namespace etendue::test {

inline RunRequest run_of(const std::string& integrator, uint64_t spp) {
    RunRequest r;
    r.integrator = integrator;
    r.seed = 3;
    r.spp = spp;
    return r;
}

}  // namespace etendue::test
