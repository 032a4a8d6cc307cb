#pragma once
// From the dialect of Mitsuba 0.4–0.6 to that of Mitsuba 3; older ones are made this dialect first, by
// mitsuba_old_versions.h.

#include <string>
#include <string_view>

#include "description/scene_description.h"

namespace etendue {

/// "maxDepth" → "max_depth", "intIOR" → "int_ior".
std::string snake_case(std::string_view camel_case);

/// Converts an object of Mitsuba 0.6, whose names are in snake case already, to the plug-ins, parameters and values
/// with the same meaning in Mitsuba 3:
///   uscale, vscale, uoffset, voffset   → to_uv, scale before offset
///   bitmap: gamma 1 or -1              → raw true or false
///   bitmap: filter_type ewa, trilinear → bilinear (there are no mip maps to select from)
///   bitmap: wrap_mode_u, wrap_mode_v   → wrap_mode, and wrap_mode_v if it differs
///   diffuse, roughdiffuse: diffuse_reflectance → reflectance
///   conductor, roughconductor without a material, eta or k → material Cu, the default of Mitsuba 0.6
///   roughdiffuse: alpha → orennayar: sigma; difftrans → diffusetransmission without reflection
///   bsdf bump → bumpmap; texture vertexcolors → mesh_attribute; film tiledhdrfilm → hdrfilm
void upgrade_object(SceneObject& object);

}  // namespace etendue
