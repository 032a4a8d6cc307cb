#include "readers/mitsuba_transform.h"

#include <fmt/format.h>

#include "math/frame.h"
#include "readers/mitsuba_values.h"

namespace etendue {
namespace {

Transform look_at(const Element& e) {
    auto triple = [&](const char* attribute) {
        return to_vec3(parse_triple(e[attribute], e.where), e.where);
    };
    const Vec3 origin = triple("origin"), target = triple("target");
    if (!(length2(target - origin) > 0))
        throw SceneError(e.where, fmt::format("<lookat>: target and origin are the same point, {}",
                                              quote(e["origin"])));
    Vec3 up = e.find("up") ? triple("up") : Vec3();
    if (up == Vec3())
        up = Frame::from_normal(normalize(target - origin)).s;  // any roll, as Mitsuba's
    const auto transform = Transform::look_at(origin, target, up);
    if (!transform)
        throw SceneError(e.where,
                         fmt::format("<lookat>: up, {}, is parallel to the viewing direction",
                                     quote(e.find("up") ? e["up"] : "0, 0, 0")));
    return *transform;
}

Transform matrix(const Element& e) {
    const std::vector<double> v = parse_floats(e["value"], e.where);
    if (v.size() != 9 && v.size() != 16)
        throw SceneError(
            e.where, fmt::format("<matrix> needs 16 or 9 numbers, row by row, found {}", v.size()));
    const size_t n = v.size() == 16 ? 4 : 3;
    Transform::Matrix m = Transform().matrix();
    for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j < n; ++j) m[i][j] = v[i * n + j];
    return Transform(m);
}

}  // namespace

std::vector<double> read_xyz(const Element& e, double fallback) {
    const std::string* axes[] = {e.find("x"), e.find("y"), e.find("z")};
    const std::string* value = e.find("value");
    const bool has_axis = axes[0] || axes[1] || axes[2];
    if (value && has_axis)
        throw SceneError(
            e.where,
            fmt::format("<{}> takes either \"value\" or \"x\", \"y\", \"z\", not both", e.name));
    if (!value && !has_axis)
        throw SceneError(e.where,
                         fmt::format("<{}> needs \"x\", \"y\", \"z\" or \"value\"", e.name));
    if (value) return parse_triple(*value, e.where);
    std::vector<double> xyz;
    for (const std::string* axis : axes)
        xyz.push_back(axis ? parse_float(*axis, e.where) : fallback);
    return xyz;
}

Transform read_transform_step(const Element& e) {
    if (e.name == "matrix") return matrix(e);
    if (e.name == "lookat" || e.name == "lookAt") return look_at(e);
    const std::vector<double> v = read_xyz(e, e.name == "scale" ? 1 : 0);
    if (e.name == "translate")
        return Transform(
            Transform::Matrix{{{1, 0, 0, v[0]}, {0, 1, 0, v[1]}, {0, 0, 1, v[2]}, {0, 0, 0, 1}}});
    if (e.name == "scale")
        return Transform(
            Transform::Matrix{{{v[0], 0, 0, 0}, {0, v[1], 0, 0}, {0, 0, v[2], 0}, {0, 0, 0, 1}}});
    const Vec3 axis = to_vec3(v, e.where);
    if (axis == Vec3()) throw SceneError(e.where, "<rotate>: the axis has length zero");
    return Transform::rotate(axis, parse_float(e["angle"], e.where));
}

}  // namespace etendue
