#pragma once

#include "integrator/integrator.h"

namespace etendue {

/// Parameters of `auto`, which chooses one of the other integrators; see with_chosen_method(). Where there is no scene to
/// choose for, it is `bdpt`.
const IntegratorEntry& auto_entry();

/// The parameter `threads`.
int threads_of_auto(const IntegratorParams& params);

inline bool is_auto(const IntegratorSpec& spec) {
    return !spec.make && spec.name == auto_entry().info.name;
}

}  // namespace etendue
