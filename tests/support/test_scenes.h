#pragma once
// Small scenes for tests, as Mitsuba XML in memory.

#include <string>

#include "readers/mitsuba_xml.h"
#include "scene/builder.h"

namespace etendue::test {

/// Sensor at `origin` looking at `target`, box filter, `size` pixels square.
inline std::string sensor(const std::string& origin, const std::string& target, int size,
                          const std::string& fov = "45", const std::string& extra = "",
                          const std::string& type = "perspective") {
    const std::string s = std::to_string(size);
    return "<sensor type=\"" + type + "\">" +
           (type == "orthographic" ? "" : "<float name=\"fov\" value=\"" + fov + "\"/>") + extra +
           "<transform name=\"to_world\">" +
           (type == "orthographic" ? "<scale value=\"0.8\"/>" : "") + "<lookat origin=\"" + origin +
           "\" target=\"" + target +
           "\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"" +
           s + "\"/><integer name=\"height\" value=\"" + s +
           "\"/><rfilter type=\"box\"/></film></sensor>";
}

/// The same sensor with another filter.
inline std::string with_filter(std::string sensor, const std::string& type) {
    const std::string box = "type=\"box\"";
    return sensor.replace(sensor.find(box), box.size(), "type=\"" + type + "\"");
}

inline std::string diffuse(const std::string& rgb) {
    return "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"" +
           rgb + "\"/></bsdf></bsdf>";
}

inline std::string rectangle(const std::string& transform, const std::string& inside) {
    return "<shape type=\"rectangle\"><transform name=\"to_world\">" + transform + "</transform>" +
           inside + "</shape>";
}

/// Shapes and sensors, each transformed further.
inline std::string transformed(std::string body, const std::string& transform) {
    const std::string end = "</transform>";
    for (size_t at = 0; (at = body.find(end, at)) != body.npos; at += transform.size() + end.size())
        body.insert(at, transform);
    return body;
}

inline Scene build(const std::string& body) {
    return build_scene(
        parse_mitsuba_xml("<scene version=\"3.0.0\">" + body + "</scene>", "test.xml"));
}

/// The room [-1, 1]³ with coloured walls, open at the front, where the camera is.
inline std::string room() {
    return rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>",
                     diffuse("0.7,0.7,0.7")) +
           rectangle("<rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>", diffuse("0.7,0.7,0.7")) +
           rectangle("<translate z=\"-1\"/>", diffuse("0.7,0.7,0.7")) +
           rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>",
                     diffuse("0.6,0.1,0.1")) +
           rectangle("<rotate y=\"1\" angle=\"-90\"/><translate x=\"1\"/>", diffuse("0.1,0.5,0.1"));
}

inline std::string area_lamp(const std::string& radiance = "12,11,9") {
    return rectangle("<scale value=\"0.25\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>",
                     diffuse("0.5,0.5,0.5") +
                         "<emitter type=\"area\"><rgb name=\"radiance\" value=\"" + radiance +
                         "\"/></emitter>");
}

inline std::string sphere(const std::string& center, const std::string& radius,
                          const std::string& bsdf) {
    return "<shape type=\"sphere\"><point name=\"center\" value=\"" + center +
           "\"/><float name=\"radius\" value=\"" + radius + "\"/>" + bsdf + "</shape>";
}

inline const std::string kRoughMetal =
    "<bsdf type=\"twosided\"><bsdf type=\"roughconductor\"><float name=\"alpha\" "
    "value=\"0.2\"/><string name=\"material\" value=\"Al\"/></bsdf></bsdf>";
inline const std::string kRoughGlass =
    "<bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\"0.3\"/></bsdf>";
inline const std::string kGlass = "<bsdf type=\"dielectric\"/>";
inline const std::string kPlastic = "<bsdf type=\"plastic\"/>";

/// An image of tests/scenes as a texture, which is repeated `times` along u and v.
inline std::string map_image(const std::string& name, const std::string& file,
                             const std::string& times) {
    return "<texture type=\"bitmap\" name=\"" + name +
           "\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR "/tests/scenes/" + file +
           "\"/><boolean name=\"raw\" value=\"true\"/><transform name=\"to_uv\"><scale value=\"" +
           times + "\"/></transform></texture>";
}
/// Materials with a map of normals, and of heights in units of `scale`.
inline std::string normal_mapped(const std::string& bsdf, const std::string& scale = "1",
                                 const std::string& times = "1") {
    return "<bsdf type=\"normalmap\">" + map_image("normalmap", "normals.ppm", times) +
           "<float name=\"scale\" value=\"" + scale + "\"/>" + bsdf + "</bsdf>";
}
inline std::string bump_mapped(const std::string& bsdf, const std::string& scale,
                               const std::string& times = "1") {
    return "<bsdf type=\"bumpmap\">" + map_image("displacement", "heights.pgm", times) +
           "<float name=\"scale\" value=\"" + scale + "\"/>" + bsdf + "</bsdf>";
}

/// Room with lamp, and spheres of rough metal, rough glass, plastic and glass.
inline std::string mixed_room(const std::string& the_sensor) {
    return the_sensor + room() + area_lamp() + sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) +
           sphere("0.4,-0.65,0.3", "0.3", kRoughGlass) + sphere("0,-0.7,-0.5", "0.3", kPlastic) +
           sphere("0.1,0.2,-0.1", "0.2", kGlass);
}

/// Dark floor and walls about a lamp in a glass ball, which no next event finds: directions of eye walks gain much. Next events
/// find two weak lamps near the floor: their selection gains, too.
inline std::string lantern_room(const std::string& the_sensor) {
    const std::string dark = diffuse("0.2,0.15,0.1"),
                      weak = "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3,2,1\"/>"
                             "</emitter>";
    return the_sensor + rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>", dark) +
           rectangle("<translate z=\"-1\"/>", dark) +
           rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>", dark) +
           sphere("-0.75,-0.8,0.5", "0.05", weak) + sphere("0.75,-0.8,0.5", "0.05", weak) +
           sphere("0,-0.1,0", "0.3", kGlass) +
           sphere("0,-0.1,0", "0.12",
                  "<emitter type=\"area\"><rgb name=\"radiance\" value=\"12,11,9\"/></emitter>");
}

inline std::string front_camera(int size) {
    return sensor("0,0,3.4", "0,0,0", size);
}
inline std::string lens_camera(int size) {
    return sensor("0,0,3.4", "0,0,0", size, "45",
                  "<float name=\"aperture_radius\" value=\"0.3\"/><float name=\"focus_distance\" "
                  "value=\"3\"/>",
                  "thinlens");
}

}  // namespace etendue::test
