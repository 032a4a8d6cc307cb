#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry pssmlt_entry();

}  // namespace etendue
