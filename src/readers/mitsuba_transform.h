#pragma once
// The steps of a <transform>: translate, rotate, scale, matrix, lookat.

#include "math/transform.h"
#include "readers/mitsuba_element.h"

namespace etendue {

/// The transform of one step. Throws SceneError where its attributes are invalid.
Transform read_transform_step(const Element& step);

/// Three components from the attributes x, y and z, each `fallback` where absent, or all from
/// `value`.
std::vector<double> read_xyz(const Element& element, double fallback);

}  // namespace etendue
