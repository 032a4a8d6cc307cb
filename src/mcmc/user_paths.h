#pragma once
// User paths [Fan, Chenney & Lai 2005, §5]: light sub-paths that a user knows to matter, from an emitter to a surface that
// scatters in all directions. Proposals follow one of them with each direction drawn from a narrow cone.
//
// Unlike in the paper, directions are uniform in solid angle, and the first point of an area emitter moves too, within a
// small disc: a fixed point would have no density there.

#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "pathspace/walk.h"

namespace etendue {

/// A path as it is written in a file.
struct GivenPath {
    static constexpr float kCone = 1;  ///< Half-angle, degrees.

    std::string name;          ///< May be empty.
    std::vector<Vec3> points;  ///< World space, from the emitter on.
    std::vector<float> cones;  ///< Half-angles in degrees: one for all segments, or one each.
    std::optional<float>
        radius;  ///< Of the disc about the first point; a hundredth of the scene's if not given.
};

/// Reads the JSON text of `file`. Throws std::runtime_error with file and place.
std::vector<GivenPath> parse_user_paths(const std::string& text, const std::string& file);
std::vector<GivenPath> read_user_paths(const std::string& file);
std::string to_json(std::span<const GivenPath> paths);

/// A path that lies on the scene's surfaces.
struct UserPath {
    struct Point {
        Vec3 p, ng;
        bool is_delta = false;  ///< Whether the path leaves it by a delta event.
        uint8_t event = 0;      ///< Number of that event, see Vertex.
        float versine = 0;      ///< 1 - cos of the cone about the direction to the next point.
    };
    const Emitter* emitter = nullptr;
    Vec2 uv;            ///< Of the first point.
    uint32_t prim = 0;  ///< Of the first point.
    float radius = 0;
    std::vector<Point> points;
};

/// A given path on the scene's surfaces, or why it is refused.
struct CheckedPath {
    std::optional<UserPath> path;
    int point = 0;  ///< The refused point, from 0.
    std::string problem;
};
CheckedPath check_user_path(const Scene& scene, const GivenPath& given);
/// `FILE: path 2 "name", point 3: …`
std::string to_string(const CheckedPath& refused, const GivenPath& given, size_t index,
                      const std::string& file);

class UserPaths {
public:
    UserPaths(const Scene& scene, std::vector<UserPath> paths)
        : scene_(&scene), paths_(std::move(paths)) {}
    /// Throws std::runtime_error where the file has a path that is refused, or has none.
    static UserPaths load(const Scene& scene, const std::string& file);

    /// Makes y_0 … y_m close to one of the paths; false where no path results.
    bool sample(const WalkContext& walk, Sampler& sampler, SubPath& y) const;
    /// Area density of y_0 … y_m, with the delta events that their vertices have. It does not know of masks.
    double density(std::span<const Vertex* const> y) const;

private:
    double density(const UserPath& path, std::span<const Vertex* const> y) const;
    /// The point of the emitter above or below `q`, a point of the disc.
    bool find_on_emitter(const UserPath& path, Vec3 q, SurfaceHit& hit) const;

    const Scene* scene_;
    std::vector<UserPath> paths_;
};

}  // namespace etendue
