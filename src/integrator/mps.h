#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry mps_entry();

}  // namespace etendue
