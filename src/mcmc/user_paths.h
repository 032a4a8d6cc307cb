#pragma once
// User paths [Fan et al. 2005, §5]: light sub-paths that a user knows to be important, from an emitter to a surface that
// scatters light in all directions. Proposals follow one of them, with each direction drawn from a narrow cone.
//
// There are two deviations from the paper. Directions are uniform in solid angle. The first point on an area emitter is
// random within a small disc, because a fixed point would have no density there.

#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "mcmc/path_density.h"
#include "pathspace/walk.h"

namespace etendue {

/// A path as it is written in a file.
struct GivenPath {
    static constexpr float kCone = 1;  ///< Half-angle, degrees.
    /// The largest coordinate. Embree ends the program at rays whose numbers exceed 1.8e18, or are not finite.
    static constexpr float kFarthest = 1e15f;

    std::string name;          ///< May be empty.
    std::vector<Vec3> points;  ///< World space, from the emitter on.
    std::vector<float> cones;  ///< Half-angles in degrees: one for all segments, or one for each.
    std::optional<float>
        radius;  ///< Of the disc about the first point, in scene units; empty: 1 % of size_around().
};

/// Reads the JSON text of `file`. Throws std::runtime_error with the file and the path or line.
std::vector<GivenPath> parse_user_paths(const std::string& text, const std::string& file);
std::vector<GivenPath> read_user_paths(const std::string& file);
std::string to_json(std::span<const GivenPath> paths);

/// A user path whose points lie on surfaces of the scene.
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

/// A user path on the scene's surfaces, or the reason why it cannot be used.
struct CheckedPath {
    std::optional<UserPath> path;
    int point = 0;  ///< Index of the point with the problem, from 0.
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
    /// Throws std::runtime_error if a path of the file cannot be used, or if it has none.
    static UserPaths load(const Scene& scene, const std::string& file);

    /// Number of vertices of the longest path.
    int longest() const;

    /// Makes y_0 … y_m close to one of the user paths. Their throughput and densities are those of a light path that was
    /// traced in the usual way and took the same course. False if the path ends early; y keeps the vertices up to there.
    bool sample(const WalkContext& walk, Sampler& sampler, SubPath& y) const;
    /// Area density with which sample() makes exactly y_0 … y_m, with the delta events at their vertices, without the
    /// effect of masks.
    PathDensity density(std::span<const Vertex* const> y) const;
    /// For each i, the density with which y_0 … y_i begin a path that starts by sample() and continues as a traced one,
    /// divided by that of a traced path. The walks use no Russian roulette before vertex longest() - 1, and no guide.
    void density_ratios(const SubPath& y, std::vector<double>& ratios) const;

private:
    /// Area density of y_0.
    double start_density(const UserPath& path, const Vertex& y0) const;
    /// Area density of y_{j+1}, given y_j.
    static double step_density(const UserPath& path, int j, const Vertex& from, const Vertex& to);
    /// The point of the emitter above or below `q`, a point of the disc; false if there is none.
    bool find_on_emitter(const UserPath& path, Vec3 q, SurfaceHit& hit) const;

    const Scene* scene_;
    std::vector<UserPath> paths_;
};

/// The scale of distances about a path through `points`: the radius of the scene's bounds, but at most three times the
/// largest distance of a point from the first one, since the scene may have distant objects, too.
float size_around(const Scene& scene, std::span<const Vec3> points);
/// Several times the rounding of coordinates as large as the largest one of `points`: smaller distances between points and
/// surfaces say nothing.
float rounding_of(std::span<const Vec3> points);

}  // namespace etendue
