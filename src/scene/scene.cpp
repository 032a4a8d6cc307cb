#include "scene/scene.h"

#include <array>
#include <new>
#include <span>

#include "math/frame.h"
#include "sensor/resized.h"
#include "texture/texture_cache.h"

namespace etendue {
namespace {

/// Largest magnitude among the terms of the coordinates of the point to which `m` maps `p`.
float largest_term(const Transform::Matrix& m, Vec3 p) {
    double most = 0;
    for (size_t i = 0; i < 3; ++i) {
        const auto& row = m[i];
        most = std::max({most, std::fabs(row[0] * p.x), std::fabs(row[1] * p.y),
                         std::fabs(row[2] * p.z), std::fabs(row[3])});
    }
    return float(most);
}

/// Transforms the geometry of an instance's shape to world space.
void transform_geometry(const Accelerator::Instance& instance, SurfaceGeometry& g) {
    const Transform& t = instance.to_world;
    g.p = t.point(g.p);
    const Vec3 ng = t.normal(g.ng);
    const float to_world = 1 / length(ng);  // of distances along the normal
    // Embree transforms rays in float, with terms that may be larger than the coordinates.
    constexpr float kErrors = 0x1p-21f;
    const float reach = largest_coordinate(g.p) + instance.translation;
    g.slack = (g.slack + kErrors * largest_term(t.inverse_matrix(), g.p) + instance.error * reach) *
              to_world;
    g.ng = ng * to_world;
    g.ns = normalize(t.normal(g.ns));
    g.dpdu = t.vector(g.dpdu);
    g.dpdv = t.vector(g.dpdv);
}

/// The first one in the order of MediumId where several are equally common.
MediumId commonest(std::span<MediumId> media) {
    MediumId best = kVacuum;
    ptrdiff_t times = 0;
    std::sort(media.begin(), media.end());
    for (auto it = media.begin(), next = it; it != media.end(); it = next) {
        next = std::upper_bound(it, media.end(), *it);
        if (next - it > times) times = next - it, best = *it;
    }
    return best;
}

RayEnd ray_end(const SurfaceGeometry& g) {
    return {g.p, g.ng, g.slack};
}

float opacity_of(const SceneShape& shape, const SurfaceGeometry& g) {
    if (shape.material->is_opaque()) return 1;
    return shape.material->opacity({g.uv, g.color, g.p, {}, {}, g.alpha, g.second_uv});
}

/// With the normal of the maps of a material, as seen from `wo`. Empty where it has no derivatives, as at poles.
std::optional<SurfaceJet> shaded(const Material& material, const TextureJet& t, Vec3d wo,
                                 SurfaceJet j) {
    auto frame = FrameOf<Vec3Dual>::from_normal_and_tangent({j.ns, j.dnsdu, j.dnsdv}, t.dpdu);
    material.turn({j.ng, wo, {t.uv, t.second_uv, {j.p, j.dpdu, j.dpdv}, t.dpdu, t.dpdv}}, frame);
    j.ns = frame.n.value();
    j.dnsdu = frame.n.by_1();
    j.dnsdv = frame.n.by_2();
    if (!std::isfinite(length(j.dnsdu) + length(j.dnsdv))) return {};
    return j;
}

bool is_opaque(const SurfaceHit& hit) {
    return hit.shape->material->is_opaque();
}

/// The medium beyond a surface that a ray along `d` passes.
MediumId medium_beyond(const SurfaceHit& hit, Vec3 d, MediumId before) {
    return hit.shape->is_interface ? hit.shape->medium_toward(hit.geometry.ng, d) : before;
}

}  // namespace

Scene::Owned::Owned() = default;
Scene::Owned::~Owned() = default;

Scene::Scene() : owned_(std::make_shared<Owned>()) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene::Scene(const Scene&) = default;

Scene Scene::seen_by_film(int width, int height) const {
    Scene other(*this);
    other.film_ = {.width = width, .height = height, .crop_width = width, .crop_height = height};
    other.sensor_ = make_resized(*sensor_, film_, width, height, filter_.radius() - 0.5f);
    return other;
}

SurfaceGeometry Scene::surface(const SurfaceLocation& at) const {
    const SceneShape& s = shapes_[at.shape];
    SurfaceGeometry g;
    if (const TriangleMesh* mesh = s.mesh())
        g = mesh->TriangleMesh::surface(at.prim, at.u, at.v, s.needs_tangents);
    else
        g = s.shape->surface(at.prim, at.u, at.v, s.needs_tangents);
    if (at.instance != kNoInstance)
        transform_geometry(owned_->accelerator.instance(at.instance), g);
    return g;
}

std::optional<SurfaceJet> Scene::jet(const SurfaceLocation& at, Vec3d o, Vec3d d,
                                     double near) const {
    const Shape& shape = *shapes_[at.shape].shape;
    const Material& material = *shapes_[at.shape].material;
    const bool has_map = material.perturbs_normals();
    if (at.instance == kNoInstance) {
        std::optional<SurfaceJet> j = shape.jet(at.prim, o, d, near);
        return j && has_map ? shaded(material, shape.texture_jet(at.prim, *j), -d, *j) : j;
    }
    const Transform& t = owned_->accelerator.instance(at.instance).to_world;
    const auto mapped = []<class V>(const Transform::Matrix& m, V v, double w) -> V {
        return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z + w * m[0][3],
                m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z + w * m[1][3],
                m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z + w * m[2][3]};
    };
    const auto mapped_normal = [&](Vec3d n) -> Vec3d {
        const Transform::Matrix& m = t.inverse_matrix();
        return {m[0][0] * n.x + m[1][0] * n.y + m[2][0] * n.z,
                m[0][1] * n.x + m[1][1] * n.y + m[2][1] * n.z,
                m[0][2] * n.x + m[1][2] * n.y + m[2][2] * n.z};
    };
    // The parameter t of the line is the same in the space of the instance.
    std::optional<SurfaceJet> j = shape.jet(at.prim, mapped(t.inverse_matrix(), o, 1),
                                            mapped(t.inverse_matrix(), d, 0), near);
    if (!j) return {};
    const TextureJet texture = has_map ? shape.texture_jet(at.prim, *j) : TextureJet();
    j->p = mapped(t.matrix(), j->p, 1);
    j->dpdu = mapped(t.matrix(), j->dpdu, 0);
    j->dpdv = mapped(t.matrix(), j->dpdv, 0);
    j->ng = normalize(mapped_normal(j->ng));
    const Vec3d n = mapped_normal(j->ns);
    const double size = length(n);
    j->ns = n / size;
    for (Vec3d* dn : {&j->dnsdu, &j->dnsdv}) {
        const Vec3d v = mapped_normal(*dn);
        *dn = (v - j->ns * dot(j->ns, v)) / size;
    }
    if (!has_map) return j;
    return shaded(material,
                  {texture.uv, texture.second_uv, mapped(t.matrix(), texture.dpdu, 0),
                   mapped(t.matrix(), texture.dpdv, 0)},
                  -d, *j);
}

Vec3 Scene::point_on(const ClearShape& clear, float u_prim, Vec2 u) const {
    const size_t n = clear.shape->primitive_count(),
                 prim = std::min(size_t(double(u_prim) * double(n)), n - 1);
    const Vec3 p = clear.shape->sample(uint32_t(prim), u).p;
    return clear.instance == kNoInstance
               ? p
               : owned_->accelerator.instance(clear.instance).to_world.point(p);
}

float Scene::opacity(const SurfaceLocation& at) const {
    return opacity_of(shapes_[at.shape], surface(at));
}

/// Finds everything but the geometry; false where the ray leaves the scene.
bool Scene::locate(const Ray& ray, SurfaceHit& hit) const {
    if (!owned_->accelerator.intersect(ray, hit.location)) return false;
    hit.shape = &shapes_[hit.location.shape];
    hit.t = hit.location.t;
    hit.has_geometry = false;
    return true;
}

void Scene::complete(SurfaceHit& hit) const {
    if (hit.has_geometry) return;
    // In place: a vector copy would stall on the stores that have just written its members.
    ::new (&hit.geometry) SurfaceGeometry(surface(hit.location));
    hit.has_geometry = true;
}

template <class Stops, class Passes>
float Scene::for_each_surface(Ray ray, SurfaceHit& hit, const Stops& stops,
                              const Passes& passes) const {
    const bool is_segment = ray.tmax < kInf;
    const Vec3 end = is_segment ? ray.o + ray.d * ray.tmax : Vec3();
    float length_d = length(ray.d);
    float skipped =
        0;  // distance from the last surface to the ray's origin, which is offset from it
    const auto rest = [&] { return ray.tmax * length_d + skipped; };
    while (ray.tmax > 0 && locate(ray, hit)) {
        hit.t = hit.t * length_d + skipped;
        if (stops()) return rest();
        complete(hit);
        if (!passes()) return rest();
        const Vec3 p = hit.geometry.p, o = offset_origin(ray_end(hit.geometry), ray.d);
        skipped = dot(o - p, ray.d) / length_d;
        ray.o = o;
        if (!is_segment) continue;
        // The offsets are aside of the ray. Its end lies so near to a surface that it must stay where it is.
        const Vec3 to_end = end - o;
        ray.tmax = dot(to_end, ray.d) > 0 ? 1.0f : 0.0f;
        ray.d = to_end;
        length_d = length(to_end);
    }
    return rest();
}

bool Scene::intersect(const Ray& ray, float u, SurfaceHit& hit, Passage& passage) const {
    const bool found = find(
        ray, [u] { return u; }, hit, passage);
    if (found) complete(hit);
    return found;
}

void Scene::prefetch_images(const SurfaceHit& hit) const {
    const SurfaceGeometry& g = hit.geometry;
    for (const BitmapTexture* image : hit.shape->images)
        image->prefetch({g.uv, g.color, g.p, {}, {}, g.alpha, g.second_uv});
}

template <class Stops>
bool Scene::find_where(const Ray& ray, const Stops& stops, SurfaceHit& hit,
                       Passage& passage) const {
    if (!has_masks_) {
        const bool found = locate(ray, hit);
        if (passage.medium != kVacuum)
            passage.attenuation = attenuation(passage.medium, found ? hit.t : kInf);
        return found;
    }
    float travelled = 0;
    bool found = false;
    // Geometry is needed where a surface may let the ray pass.
    for_each_surface(
        ray, hit,
        [&] {
            travelled += hit.t;
            passage.attenuation *= attenuation(passage.medium, hit.t);
            return found = is_opaque(hit);
        },
        [&] {
            found = stops(opacity_of(*hit.shape, hit.geometry));
            if (!found) passage.medium = medium_beyond(hit, ray.d, passage.medium);
            return !found;
        });
    if (found)
        hit.t = travelled;
    else
        passage.attenuation *= attenuation(passage.medium, kInf);
    return found;
}

bool Scene::find(const Ray& ray, const std::function<float()>& number, SurfaceHit& hit,
                 Passage& passage) const {
    std::optional<float> u;
    const auto stops = [&](float opacity) {
        if (!u) u = number();
        if (*u < opacity) return true;
        u = std::min((*u - opacity) / (1 - opacity), kOneMinusEpsilon);
        return false;
    };
    return find_where(ray, stops, hit, passage);
}

bool Scene::find_certain(const Ray& ray, SurfaceHit& hit, Passage& passage) const {
    float Tr = 1;
    const auto stops = [&](float opacity) {
        if (opacity >= 1) return true;
        Tr *= 1 - opacity;
        return false;
    };
    const bool found = find_where(ray, stops, hit, passage);
    passage.attenuation *= Tr;
    return found;
}

bool Scene::intersect(const Ray& ray, float u, SurfaceHit& hit) const {
    Passage passage;
    return intersect(ray, u, hit, passage);
}

float Scene::masked_transmittance(const Ray& ray) const {
    float Tr = 1;
    SurfaceHit hit;
    for_each_surface(
        ray, hit,
        [&] {
            if (is_opaque(hit)) Tr = 0;
            return Tr == 0;
        },
        [&] {
            Tr *= 1 - opacity_of(*hit.shape, hit.geometry);
            return Tr > 0;
        });
    return Tr;
}

Rgb Scene::attenuation(MediumId medium, const Ray& ray) const {
    Rgb product(1);
    SurfaceHit hit;
    const float rest = for_each_surface(
        ray, hit,
        [&] {
            product *= attenuation(medium, hit.t);
            return is_opaque(hit);
        },
        [&] {
            medium = medium_beyond(hit, ray.d, medium);
            return true;
        });
    return product * attenuation(medium, std::max(0.0f, rest));
}

/// A shadow ray from `a` to `b` with parameters in [0, 1]; both ends are moved off their surfaces.
Ray Scene::segment(const RayEnd& a, const RayEnd& b) const {
    const Vec3 d = b.p - a.p;
    const Vec3 from = offset_origin(a, d);
    // Bound for the rounding error of the distance at which the ray meets the far surface.
    constexpr float kRoundings = 8 * 0x1p-24f;
    const float error = kRoundings * length(d);
    const Vec3 to = offset_origin(b, -d) + b.ng * std::copysign(error, -dot(b.ng, d));
    return {from, to - from, 1};
}

float Scene::transmittance(const Ray& ray) const {
    // Most rays are blocked or meet no mask, and a query for any obstacle is cheaper than one for the nearest surface.
    const Obstacle obstacle = owned_->accelerator.obstacle(ray);
    if (obstacle == Obstacle::Passable) return masked_transmittance(ray);
    return obstacle == Obstacle::None ? 1.0f : 0.0f;
}

float Scene::transmittance(const RayEnd& a, const RayEnd& b) const {
    return transmittance(segment(a, b));
}

float Scene::transmittance_to_infinity(const RayEnd& a, Vec3 d) const {
    return transmittance({offset_origin(a, d), d, kInf});
}

Rgb Scene::attenuation(MediumId medium, const RayEnd& a, const RayEnd& b) const {
    return has_open_boundaries_ ? attenuation(medium, segment(a, b))
                                : attenuation(medium, length(b.p - a.p));
}

Rgb Scene::attenuation_to_infinity(MediumId medium, const RayEnd& a, Vec3 d) const {
    return has_open_boundaries_ ? attenuation(medium, Ray{offset_origin(a, d), d, kInf})
                                : attenuation(medium, kInf);
}

MediumId Scene::medium_around(const RayEnd& at) const {
    if (media_.empty()) return kVacuum;
    // Boundaries need not be closed, such as the surface of a lake. So several directions vote; those that end at an
    // opaque surface have no vote, unless all of them do.
    constexpr int kDirections = 9;
    constexpr float kGoldenAngle = 2.399963f;
    std::array<MediumId, kDirections> votes;
    auto end = votes.begin();
    for (const bool through_opaque : {false, true}) {
        for (int i = 0; i < kDirections; ++i) {
            // A spiral over the sphere, whose directions lie in no plane of symmetry.
            const float z = 1 - (2 * float(i) + 1) / kDirections, sine = safe_sqrt(1 - sqr(z)),
                        phi = kGoldenAngle * float(i) + 0.1f;
            Vec3 d{sine * std::cos(phi), sine * std::sin(phi), z};
            if (dot(d, at.ng) < 0) d = -d;
            MediumId medium = kVacuum;
            bool votes_here = true;
            SurfaceHit hit;
            for_each_surface(
                {offset_origin(at, d), d, kInf}, hit,
                [&] {
                    votes_here = through_opaque || hit.shape->is_interface || !is_opaque(hit);
                    return !votes_here;
                },
                [&] {
                    if (!hit.shape->is_interface) return true;
                    medium = hit.shape->medium_toward(hit.geometry.ng, -d);
                    return false;
                });
            if (votes_here) *end++ = medium;
        }
        if (end != votes.begin()) break;
    }
    return commonest(std::span(votes.begin(), end));
}

}  // namespace etendue
