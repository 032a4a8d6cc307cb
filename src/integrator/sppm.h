#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry sppm_entry();
IntegratorEntry ppm_entry();

}  // namespace etendue
