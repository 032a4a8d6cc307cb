#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry pm_entry();

}  // namespace etendue
