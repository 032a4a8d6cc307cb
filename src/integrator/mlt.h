#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry mlt_entry();

}  // namespace etendue
