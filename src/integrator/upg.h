#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry upg_entry();
IntegratorEntry upg_bdpt_entry();

}  // namespace etendue
