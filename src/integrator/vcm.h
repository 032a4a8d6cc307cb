#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry vcm_entry();

}  // namespace etendue
