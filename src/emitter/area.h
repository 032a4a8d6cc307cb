#pragma once

#include "emitter/emitter.h"

namespace etendue {

std::unique_ptr<Emitter> make_area_emitter(const Shape& shape, TextureRef radiance,
                                           bool two_sided = false, double power = 0,
                                           std::function<float(const TexturePoint&)> opacity = {});
EmitterEntry area_entry();

}  // namespace etendue
