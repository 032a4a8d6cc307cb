#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry direct_entry();

}  // namespace etendue
