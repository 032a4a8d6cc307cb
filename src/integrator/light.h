#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry light_entry();

}  // namespace etendue
