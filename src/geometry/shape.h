#pragma once
// Shapes: triangle meshes, and quadrics, which are not tessellated since caustics would show the facets.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "geometry/surface_jet.h"
#include "math/bounds.h"
#include "math/prefetch.h"
#include "math/transform.h"
#include "math/vec.h"

namespace etendue {

/// A point on a shape with the differential geometry that shading needs. World space. The coordinates of p are rounded
/// once, so its distance from the surface is that of the rounding, however large the shape is.
struct SurfaceGeometry {
    Vec3 p;
    Vec3 ng;          ///< Unit geometric normal, on the same side as ns.
    Vec3 ns;          ///< Unit interpolated normal.
    Vec3 dpdu, dpdv;  ///< Zero unless requested.
    Vec2 uv;
    Vec2 second_uv;       ///< Another set of texture coordinates; zero where the shape has one.
    Vec3 color{1, 1, 1};  ///< Interpolated vertex colour; white where the shape has none.
    float alpha = 1;      ///< Of the vertex colour.
    /// Bound of the distance from p, along the normal, at which a ray from p may meet the same primitive again because
    /// of the rounding in its intersection. The rounding of p is not part of it.
    float slack = 0;
};

/// A point drawn from a shape's surface.
struct ShapeSample {
    Vec3 p, ng;
    Vec2 uv;  ///< Parameters within the primitive, as in RayHit.
    uint32_t prim;
    float slack = 0;    ///< As SurfaceGeometry::slack.
    float density = 1;  ///< Shape::seen_density() of what sample_seen() returns.
};

class Shape {
public:
    virtual ~Shape() = default;
    virtual Bounds3 bounds() const = 0;
    virtual double area() const = 0;
    virtual size_t primitive_count() const { return 1; }
    virtual double primitive_area(uint32_t) const { return area(); }
    /// Geometry at parameters (u, v) of primitive `prim`, as in RayHit; dpdu and dpdv only if `tangents`.
    virtual SurfaceGeometry surface(uint32_t prim, float u, float v, bool tangents) const = 0;
    /// Differential geometry where the line o + t·d meets `prim`, which extends beyond its edges: of several points the one
    /// with t nearest to `near`. Empty where there is none.
    virtual std::optional<SurfaceJet> jet(uint32_t prim, Vec3d o, Vec3d d, double near) const = 0;
    /// Texture coordinates at the point of jet().
    virtual TextureJet texture_jet(uint32_t prim, const SurfaceJet& at) const = 0;
    /// SurfaceGeometry::slack of the points of a primitive.
    virtual float slack(uint32_t) const { return 0; }
    /// Uniform in area on primitive `prim`.
    virtual ShapeSample sample(uint32_t prim, Vec2 u) const = 0;
    /// A point of `prim` for an observer at `from`. Points that an opaque shape hides from there may be left out.
    virtual ShapeSample sample_seen(uint32_t prim, Vec3 /*from*/, Vec2 u) const {
        return sample(prim, u);
    }
    /// Density of sample_seen() at `p` with the normal `ng`, relative to that of sample().
    virtual float seen_density(uint32_t /*prim*/, Vec3 /*p*/, Vec3 /*ng*/, Vec3 /*from*/) const {
        return 1;
    }
    virtual size_t memory_bytes() const { return sizeof(*this); }
};

class TriangleMesh final : public Shape {
public:
    using Triangle = std::array<uint32_t, 3>;  ///< Indices of vertices.
    struct Arrays {
        std::vector<Vec3> positions{};
        std::vector<Vec3> normals{};     ///< Empty, or one unit vector per vertex.
        std::vector<Vec2> uvs{};         ///< Empty, or one per vertex.
        std::vector<Vec2> second_uvs{};  ///< The same.
        std::vector<Vec3> colors{};      ///< Empty, or one per vertex.
        std::vector<float> alphas{};     ///< Of the colours; empty, or one per vertex.
        std::vector<Triangle> triangles{};
    };
    /// What a hit reads of a vertex, and of a triangle, lies together: a hit takes few cache lines. Embree reads points and
    /// indices in place.
    struct alignas(32) Vertex {
        Vec3 p, n;  ///< n is a unit vector if the mesh has normals.
        Vec2 uv;
    };
    struct Face {
        Triangle vertices;
        Vec3 ng;      ///< Unit normal.
        float slack;  ///< As SurfaceGeometry::slack.
    };

    /// Leaves out triangles whose area is zero in single precision.
    explicit TriangleMesh(Arrays arrays);

    const std::vector<Vertex>& vertices() const { return vertices_; }
    const std::vector<Face>& faces() const { return faces_; }
    /// The arrays of the mesh, copied.
    Arrays arrays() const;

    Bounds3 bounds() const override;
    double area() const override;
    size_t primitive_count() const override { return faces_.size(); }
    double primitive_area(uint32_t prim) const override;
    /// (u, v) are the barycentric coordinates of the second and third vertex.
    SurfaceGeometry surface(uint32_t prim, float u, float v, bool tangents) const override;
    std::optional<SurfaceJet> jet(uint32_t prim, Vec3d o, Vec3d d, double near) const override;
    TextureJet texture_jet(uint32_t prim, const SurfaceJet& at) const override;
    float slack(uint32_t prim) const override { return faces_[prim].slack; }
    ShapeSample sample(uint32_t prim, Vec2 u) const override;
    size_t memory_bytes() const override;

    /// Asks for the memory that surface() reads. The second function reads what the first one has asked for.
    void prefetch_face(uint32_t prim) const { prefetch(faces_[prim]); }
    void prefetch_vertices(uint32_t prim) const {
        for (const uint32_t i : faces_[prim].vertices) prefetch(vertices_[i]);
    }

private:
    /// The normal of the face on the side of the vertex normals, whose mean at the point is `n`.
    static Vec3 turned(Vec3 ng, Vec3 n) { return dot(ng, n) < 0 ? -ng : ng; }

    std::vector<Vertex> vertices_;
    std::vector<Face> faces_;
    std::vector<Vec2> second_uvs_;
    std::vector<Vec3> colors_;
    std::vector<float> alphas_;
    bool has_normals_, has_uvs_;
};

/// A shape that Embree intersects through a callback, in double.
class AnalyticShape : public Shape {
public:
    /// An intersection at o + t·d; t is double, since `o` may be far away.
    struct Hit {
        double t;
        Vec3
            local;  ///< The point in the shape's own coordinates, from which parameters() are computed.
    };
    /// The nearest intersection with t in (tmin, tmax); false where there is none.
    virtual bool intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const = 0;
    /// The parameters (u, v) of a hit. Candidates that are not the nearest hit, and shadow rays, do not need them.
    virtual Vec2 parameters(Vec3 local) const = 0;
    /// The parameters of a point of a grid over the shape: the unit square covers the shape once.
    virtual Vec2 grid_parameters(Vec2 in_square) const { return in_square; }
};

/// Sphere with (u, v) = (azimuth over 2π, polar angle over π) about the axis from its centre through the origin: so
/// points near the origin, whose coordinates are finest, are found again from their parameters however large the sphere
/// is. Its texture coordinates are the same angles about its own +z.
class Sphere final : public AnalyticShape {
public:
    Sphere(Vec3 center, float radius, bool flip_normals);
    /// The unit sphere under a transform of uniform scale.
    Sphere(const Transform& to_world, bool flip_normals);

    Bounds3 bounds() const override;
    double area() const override;
    SurfaceGeometry surface(uint32_t, float u, float v, bool tangents) const override;
    std::optional<SurfaceJet> jet(uint32_t, Vec3d o, Vec3d d, double near) const override;
    TextureJet texture_jet(uint32_t, const SurfaceJet& at) const override;
    float slack(uint32_t) const override { return slack_; }
    ShapeSample sample(uint32_t, Vec2 u) const override;
    /// From outside, uniform in the solid angle of the sphere.
    ShapeSample sample_seen(uint32_t, Vec3 from, Vec2 u) const override;
    float seen_density(uint32_t, Vec3 p, Vec3 ng, Vec3 from) const override;
    bool intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const override;
    Vec2 parameters(Vec3 local) const override;

private:
    struct Direction {
        double x, y, z;
    };
    /// The sphere as an observer outside sees it.
    struct Seen {
        Vec3d to_observer;  ///< Unit vector from the centre.
        double sine;        ///< Of half the angle that the sphere subtends.
        double one_minus_cosine;
    };
    /// Empty where the observer is not outside, or normals point inward.
    std::optional<Seen> seen(Vec3 from) const;
    /// The point and its normals.
    SurfaceGeometry at(const Direction& in_axes) const;
    void choose_axes();

    Transform orientation_, to_local_;  ///< Rotation of the texture coordinates.
    std::array<Direction, 3> axes_;     ///< Those of the parameters; orthonormal.
    Vec3 center_;
    float radius_, slack_;
    bool flip_;
};

/// Affine image of the unit disc in the xy plane with normal +z; texture coordinates (radius, azimuth over 2π). The
/// parameters (u, v) are the disc's own x and y, relative to the disc's point nearest to the origin: see Sphere.
class Disk final : public AnalyticShape {
public:
    Disk(const Transform& to_world, bool flip_normals);

    Bounds3 bounds() const override;
    double area() const override;
    SurfaceGeometry surface(uint32_t, float u, float v, bool tangents) const override;
    std::optional<SurfaceJet> jet(uint32_t, Vec3d o, Vec3d d, double near) const override;
    TextureJet texture_jet(uint32_t, const SurfaceJet& at) const override;
    ShapeSample sample(uint32_t, Vec2 u) const override;
    bool intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const override;
    Vec2 parameters(Vec3 local) const override;
    Vec2 grid_parameters(Vec2 in_square) const override;

private:
    Transform to_world_, to_local_;
    std::array<double, 2> near_;  ///< Own coordinates of the point nearest to the origin.
    Vec3 ng_;
};

/// Open cylinder from p0 to p1 under a transform without shear; normals point outward; texture coordinates (azimuth
/// over 2π, height over length). The parameters (u, v) are the same, relative to the cylinder's point nearest to the
/// origin: see Sphere.
class Cylinder final : public AnalyticShape {
public:
    /// `to_world` maps the unit cylinder about +z (radius 1, z in [0, 1]) to the world.
    Cylinder(const Transform& to_world, bool flip_normals);

    Bounds3 bounds() const override;
    double area() const override;
    SurfaceGeometry surface(uint32_t, float u, float v, bool tangents) const override;
    std::optional<SurfaceJet> jet(uint32_t, Vec3d o, Vec3d d, double near) const override;
    TextureJet texture_jet(uint32_t, const SurfaceJet& at) const override;
    ShapeSample sample(uint32_t, Vec2 u) const override;
    bool intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const override;
    Vec2 parameters(Vec3 local) const override;
    Vec2 grid_parameters(Vec2 in_square) const override;

private:
    Transform to_world_, to_local_;
    std::array<double, 3> near_;  ///< Own coordinates of the point nearest to the origin.
    float radius_, height_;
    bool flip_;
};

}  // namespace etendue
