#pragma once

#include "integrator/integrator.h"

namespace etendue {

IntegratorEntry pcbpt_entry();

}  // namespace etendue
