#pragma once

#include "emitter/emitter.h"

namespace etendue {

std::unique_ptr<Emitter> make_area_emitter(const Shape& shape, TextureRef radiance);
EmitterEntry area_entry();

}  // namespace etendue
