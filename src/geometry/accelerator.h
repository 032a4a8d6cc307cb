#pragma once
// Ray queries over shapes and instances, by Embree. The only part that includes it.

#include <memory>
#include <vector>

#include "geometry/ray.h"
#include "geometry/shape.h"

namespace etendue {

inline constexpr uint32_t kNoInstance = 0xffffffffu;

/// A surface point by name: all that is needed to find its geometry again.
struct SurfaceLocation {
    uint32_t shape = 0;  ///< Index of the shape in the order of add_shape / add_group.
    uint32_t prim = 0;
    uint32_t instance = kNoInstance;
    float u = 0, v = 0;  ///< Parameters within the primitive.
};

/// What a ray met.
struct RayHit : SurfaceLocation {
    float t;
};

struct AcceleratorOptions {
    /// No ray slips through between two triangles. Without it one in millions does, that meets an edge within rounding, and
    /// all are a tenth to a fifth faster.
    bool is_watertight = false;
};

/// Shapes are added, then committed once; queries are thread-safe after that.
class Accelerator {
public:
    explicit Accelerator(const AcceleratorOptions& options = {});
    ~Accelerator();
    Accelerator(Accelerator&&) noexcept;
    Accelerator& operator=(Accelerator&&) noexcept;

    /// The shape must outlive the accelerator. Returns its index.
    uint32_t add_shape(const Shape& shape);
    /// Shapes that appear only through instances. Returns the group's index; indices of the shapes continue the count.
    uint32_t add_group(const std::vector<const Shape*>& shapes);
    uint32_t add_instance(uint32_t group, const Transform& to_world);
    /// Builds the hierarchies; throws std::runtime_error with Embree's own message.
    void commit();

    bool intersect(const Ray& ray, RayHit& hit) const;
    /// Whether anything lies within (0, ray.tmax).
    bool occluded(const Ray& ray) const;

    const Transform& instance_transform(uint32_t instance) const;
    size_t memory_bytes() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace etendue
