#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry path_entry();

}  // namespace etendue
