#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry mmlt_entry();

}  // namespace etendue
