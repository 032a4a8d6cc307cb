#pragma once
// A scene in which every technique has something to do, in any units, and all integrators for it.

#include <cctype>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrator/integrator.h"
#include "test_scenes.h"

namespace etendue::test {

/// Factors, relative to the units of the scene below, and where its origin lies, in units of its length. A small object
/// may lie at the origin of the world. Light paths from the sky hardly ever hit a small part of a scene, so then there
/// should be none.
struct Units {
    float radiance = 1, length = 1;
    Vec3 origin{};
    bool has_object_at_origin = false, has_sky = true;
};
inline void PrintTo(const Units& u, std::ostream* out) {
    *out << "radiance * " << u.radiance << ", length * " << u.length;
}

inline std::string scaled_rgb(const char* name, Rgb value, float factor) {
    return fmt::format("<rgb name=\"{}\" value=\"{:.9g},{:.9g},{:.9g}\"/>", name, value.r * factor,
                       value.g * factor, value.b * factor);
}
inline std::string scaled_point(Vec3 v, float factor) {
    return fmt::format("{:.9g},{:.9g},{:.9g}", v.x * factor, v.y * factor, v.z * factor);
}

/// A room with glass, rough and smooth, seen through a lens: every technique has something to do. The tent makes splats
/// reach several pixels.
inline Scene lit_room(Units u) {
    const auto at = [&](Vec3 p) { return scaled_point(p + u.origin, u.length); };
    const auto placed = [&](const std::string& transform) {
        return fmt::format("{}<translate value=\"{}\"/><scale value=\"{:.9g}\"/>", transform,
                           scaled_point(u.origin, 1), u.length);
    };
    const auto ball = [&](Vec3 center, float radius, const std::string& bsdf) {
        return sphere(at(center), fmt::format("{:.9g}", radius * u.length), bsdf);
    };
    const auto wall = [&](const std::string& transform, const char* reflectance) {
        return rectangle(placed(transform), diffuse(reflectance));
    };
    const std::string camera = fmt::format(
        "<sensor type=\"thinlens\"><float name=\"fov\" value=\"45\"/><float "
        "name=\"aperture_radius\" value=\"{:.9g}\"/><float name=\"focus_distance\" "
        "value=\"{:.9g}\"/><transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" "
        "up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" "
        "value=\"16\"/><integer name=\"height\" value=\"16\"/><rfilter type=\"tent\"/></film>"
        "</sensor>",
        0.3f * u.length, 3 * u.length, at({0, 0, 3.4f}), at({}));
    const std::string lamp = rectangle(
        placed("<scale value=\"0.25\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>"),
        diffuse("0.5,0.5,0.5") + "<emitter type=\"area\">" +
            scaled_rgb("radiance", {12, 11, 9}, u.radiance) + "</emitter>");
    return build(
        camera + wall("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>", "0.7,0.7,0.7") +
        wall("<rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>", "0.7,0.7,0.7") +
        wall("<translate z=\"-1\"/>", "0.7,0.7,0.7") +
        wall("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>", "0.6,0.1,0.1") +
        wall("<rotate y=\"1\" angle=\"-90\"/><translate x=\"1\"/>", "0.1,0.5,0.1") + lamp +
        ball({-0.5f, -0.6f, 0.2f}, 0.35f, kRoughMetal) +
        ball({0.4f, -0.65f, 0.3f}, 0.3f, kRoughGlass) + ball({0.1f, 0.2f, -0.1f}, 0.2f, kGlass) +
        "<emitter type=\"point\"><point name=\"position\" value=\"" + at({0.3f, 0.1f, 0.7f}) +
        "\"/>" + scaled_rgb("intensity", {0.3f, 0.5f, 0.4f}, u.radiance * sqr(u.length)) +
        "</emitter>" +
        (u.has_sky ? "<emitter type=\"constant\">" +
                         scaled_rgb("radiance", {0.3f, 0.4f, 0.5f}, u.radiance) + "</emitter>"
                   : "") +
        (u.has_object_at_origin ? sphere("0,0,0", "0.01", diffuse("0.5,0.5,0.5")) : ""));
}

/// Every integrator, and those with options that change how they work, as fast as a test needs them.
inline std::vector<std::string> all_integrators() {
    std::vector<std::string> all;
    for (const IntegratorEntry& e : integrator_registry()) {
        const std::string name = e.info.name;
        all.push_back(name == "pm"    ? "pm:light_paths=2000"
                      : name == "mps" ? "mps:mutations=2000,precision=0.2"
                                      : name);
    }
    all.insert(all.end(), {"bdpt:eorr=true", "vcm:exact=true",
                           "pm:light_paths=2000,cache_error=0.3,cache_rays=32"});
    return all;
}

inline std::string name_of_integrator(const ::testing::TestParamInfo<std::string>& p) {
    std::string name = p.param;
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

}  // namespace etendue::test
