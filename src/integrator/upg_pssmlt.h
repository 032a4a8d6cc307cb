#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry upg_pssmlt_entry();

}  // namespace etendue
