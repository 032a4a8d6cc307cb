#pragma once

#include "emitter/emitter.h"

namespace etendue {

EmitterEntry point_entry();
EmitterEntry spot_entry();

}  // namespace etendue
