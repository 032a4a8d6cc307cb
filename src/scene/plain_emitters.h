#pragma once
// Emitters of a scene for Mitsuba 3.

#include "scene/plain_scene.h"

namespace etendue {

/// Replaces an emitter that Mitsuba 3 lacks, or parameters that it lacks.
void replace_emitter(PlainScene& s, int index);
/// Emission of a shape is hidden by its mask here, but not in Mitsuba 3.
void report_masked_emission(PlainScene& s, int index);
/// Leaves out all environments but the first.
void keep_one_environment(PlainScene& s);

}  // namespace etendue
