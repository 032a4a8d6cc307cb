#pragma once
// Materials of a scene for Mitsuba 3.

#include "scene/plain_scene.h"

namespace etendue {

/// Replaces a material that Mitsuba 3 lacks, or parameters that it lacks.
void replace_bsdf(PlainScene& s, int index);
/// In Mitsuba 3 a material of both sides must not let light through: a mask or a blend stands outside of it.
void hoist_masks(PlainScene& s, int index);

}  // namespace etendue
