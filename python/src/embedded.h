#pragma once
// Meshes and images that a description holds itself, as dicts with arrays.

#include "bindings.h"
#include "values.h"

namespace etendue::python {

/// The parameter of an object that is the number of a mesh or of an image of the description, which dicts hold in its
/// place; nullptr if it has none.
const char* embedded_parameter(const SceneObject& object);

/// The mesh or image that the parameter is the number of, without copies; the number itself if there is none.
nb::object embedded_to_python(const SceneDescription& scene, const SceneObject& object,
                              const Param& param);
/// Adds a mesh or an image to the description, and returns its number. Throws SceneError.
int64_t add_embedded(SceneDescription& scene, const SceneObject& object, nb::dict value,
                     const SourceLocation& where);

}  // namespace etendue::python
