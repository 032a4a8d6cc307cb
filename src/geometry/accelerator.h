#pragma once
// Ray queries over shapes and instances with Embree. No other file includes its headers.

#include <memory>
#include <utility>
#include <vector>

#include "geometry/ray.h"
#include "geometry/shape.h"

namespace etendue {

inline constexpr uint32_t kNoInstance = 0xffffffffu;

/// Identifies a surface point: everything needed to compute its geometry again.
struct SurfaceLocation {
    uint32_t shape = 0;  ///< Index of the shape in the order of add_shape / add_group.
    uint32_t prim = 0;
    uint32_t instance = kNoInstance;
    float u = 0, v = 0;  ///< Parameters within the primitive.
};

/// The nearest intersection of a ray, at o + t·d.
struct RayHit : SurfaceLocation {
    float t;
};

/// Memory that is free, or what the process may use of it if that is less.
size_t memory_of_machine();

/// What a ray meets.
enum class Obstacle : uint8_t {
    None,
    Passable,  ///< Shapes that may let it pass, and no others.
    Opaque,
};

struct AcceleratorOptions {
    /// Lets no ray pass between adjacent triangles. Otherwise about one ray in millions does, where it meets an edge to
    /// within rounding, and rays are 10 to 20 % faster.
    bool is_watertight = false;
    /// What the hierarchy may take, without the meshes.
    size_t most_bytes = memory_of_machine();
};

/// Shapes are added, then committed once; queries are thread-safe after that. Copies share the hierarchy.
class Accelerator {
public:
    /// A group at its place.
    struct Instance {
        Transform to_world;
        /// Bound of the error of a ray that Embree transforms to the space of the instance, in units of that space: relative
        /// to the largest coordinate of its origin plus `translation`.
        float error;
        float translation;                     ///< The largest coordinate of what `to_world` adds.
        std::pair<uint32_t, uint32_t> shapes;  ///< Indices [first, second) of what it shows.
    };

    struct Member {
        const Shape* shape;              ///< Must outlive the accelerator.
        bool may_let_rays_pass = false;  ///< See obstacle().
        auto operator<=>(const Member&) const = default;
    };

    explicit Accelerator(const AcceleratorOptions& options = {});
    /// One that takes the hierarchies of groups of the same members from an earlier one with the same options.
    Accelerator(const AcceleratorOptions& options, const Accelerator& earlier);

    /// Returns the index of the shape.
    uint32_t add_shape(const Member& member);
    /// Adds shapes that are visible only through instances; they take the next shape indices. Returns the group's
    /// index.
    uint32_t add_group(const std::vector<Member>& members);
    uint32_t add_instance(uint32_t group, const Transform& to_world);
    /// Builds the hierarchy; throws std::runtime_error where Embree fails.
    void commit();

    /// The nearest intersection with t in (0, ray.tmax); false where there is none.
    bool intersect(const Ray& ray, RayHit& hit) const;
    /// What there is with t in (0, ray.tmax).
    Obstacle obstacle(const Ray& ray) const;

    size_t instance_count() const;
    const Instance& instance(uint32_t index) const;
    size_t memory_bytes() const;

private:
    struct Impl;
    std::shared_ptr<Impl> impl_;
};

}  // namespace etendue
