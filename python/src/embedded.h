#pragma once
// Meshes and images that a description holds itself, as dicts with arrays.

#include "bindings.h"
#include "values.h"

namespace etendue::python {

/// The parameter of an object that is the number of a mesh or of an image of the description, which dicts hold in its
/// place; nullptr if it has none.
const char* embedded_parameter(const SceneObject& object);
/// Whether dicts may give a part of the mesh or the image under this name beside the other parameters of the object, such as
/// "vertices" or "data".
bool is_embedded_part(const SceneObject& object, const std::string& name);

/// The mesh or image that the parameter is the number of, without copies; the number itself if there is none.
nb::object embedded_to_python(const SceneDescription& scene, const SceneObject& object,
                              const Param& param);
/// The part of this name; None if the object has none.
nb::object embedded_part(const SceneDescription& scene, const SceneObject& object,
                         const std::string& name);
/// The mesh or image with another part of this name, as a dict for embed().
nb::dict with_part(const SceneDescription& scene, const SceneObject& object,
                   const std::string& name, nb::handle value);

/// Gives an object (by index) a mesh or an image, in the place of its old one. Throws SceneError.
void embed(SceneDescription& scene, int object, nb::dict value, const SourceLocation& where);

}  // namespace etendue::python
