#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry bdpt_entry();

}  // namespace etendue
