#include "yardstick.h"

#include "math/frame.h"
#include "math/warp.h"
#include "sampler/sampler.h"

namespace etendue::bench {
namespace {

/// A closed room: a sphere of radius 2 with bumps. There are heavier scenes of as many triangles,
/// where Embree is slower by half; against a light one, normalised figures err on the low side.
TriangleMesh make_room() {
    constexpr uint32_t kColumns = 316, kRows = kColumns / 2;
    TriangleMesh::Arrays mesh;
    for (uint32_t row = 0; row <= kRows; ++row)
        for (uint32_t column = 0; column < kColumns; ++column) {
            const float theta = kPi * float(row) / float(kRows);
            const float phi = 2 * kPi * float(column) / float(kColumns);
            const float bumps = 0.06f * std::sin(17 * theta) * std::sin(13 * phi);
            const Vec3 d{std::sin(theta) * std::cos(phi), std::cos(theta),
                         std::sin(theta) * std::sin(phi)};
            mesh.positions.push_back(d * (2 + 2 * bumps));
        }
    for (uint32_t row = 0; row < kRows; ++row)
        for (uint32_t column = 0; column < kColumns; ++column) {
            const uint32_t a = row * kColumns + column;
            const uint32_t b = row * kColumns + (column + 1) % kColumns;
            mesh.triangles.push_back({a, b, a + kColumns});
            mesh.triangles.push_back({b, b + kColumns, a + kColumns});
        }
    return TriangleMesh(std::move(mesh));
}

Accelerator make_accelerator(const TriangleMesh& mesh) {
    Accelerator accelerator;
    accelerator.add_shape({&mesh});
    accelerator.commit();
    return accelerator;
}

}  // namespace

Yardstick::Yardstick()
    : mesh_(make_room()), accelerator_(make_accelerator(mesh_)), rays_([this] {
          constexpr uint64_t kPaths = 1 << 14;
          for (uint64_t i = 0; i < kPaths; ++i) trace_path(i);
      }) {}

void Yardstick::trace_path(uint64_t index) const {
    constexpr uint32_t kBounces = 8;
    Sampler sampler(SamplerKind::Independent, 0);
    sampler.start(0, index);
    Ray ray{{}, sample_uniform_sphere(sampler.next_2d()), kInf};
    RayHit hit;
    for (uint32_t bounce = 0; bounce < kBounces && accelerator_.intersect(ray, hit); ++bounce) {
        const SurfaceGeometry g = mesh_.surface(hit.prim, hit.u, hit.v, false);
        const Vec3 n = dot(g.ng, ray.d) < 0 ? g.ng : -g.ng;
        sampler.seek(Stream::Eye, bounce + 1);
        const Vec2 u_lamp = sampler.next_2d();
        // A square lamp in the upper half.
        const Vec3 lamp{0.4f * (u_lamp.x - 0.5f), 1.2f, 0.4f * (u_lamp.y - 0.5f)};
        const Vec3 o = offset_origin({g.p, n, g.slack}, n);
        accelerator_.obstacle({o, lamp - o, 1});
        const Vec3 wi = sample_cosine_hemisphere(sampler.next_2d());
        ray = {o, Frame::from_normal(n).to_world(wi), kInf};
    }
}

}  // namespace etendue::bench
