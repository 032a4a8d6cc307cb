#include "geometry/shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <utility>

#include "math/triangle.h"
#include "math/warp.h"
#include "system/huge_pages.h"

namespace etendue {

// ---- TriangleMesh

namespace {

/// Embree computes (a - o)·N / (d·N) in float. On turned rectangles of 2,000 and 200,000 units, the error of its terms was
/// no more than 2^-23 of the longest coordinate difference; the rest of the first term is a margin. The second term is what
/// the rounding of N tilts the plane, which is more where triangles are thin. Embree fuses one of the two products of a
/// component or none.
float triangle_slack(Vec3 e1, Vec3 e2) {
    constexpr float kErrors = 0x1p-21f;
    float longest = 0;
    for (const int i : {0, 1, 2}) longest = std::max({longest, std::fabs(e1[i]), std::fabs(e2[i])});
    double tilt = 0;
    for (const auto& [first_rounds, second_rounds] :
         {std::pair(true, true), {false, true}, {true, false}}) {
        const auto product = [](float a, float b, bool rounds) {
            const double exact = double(a) * b;
            return rounds ? double(float(exact)) : exact;
        };
        double n2 = 0, along_e1 = 0, along_e2 = 0;
        for (const int i : {0, 1, 2}) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double n =
                float(product(e1[j], e2[k], first_rounds) - product(e1[k], e2[j], second_rounds));
            n2 += n * n;
            along_e1 += n * e1[i];
            along_e2 += n * e2[i];
        }
        if (!(n2 > 0)) continue;
        // No more than the height of the triangle: where it has next to none, N can be anything.
        const double height = std::sqrt(n2) / longest;
        tilt = std::max(
            tilt,
            std::min(std::max(std::fabs(along_e1), std::fabs(along_e2)) / std::sqrt(n2), height));
    }
    return kErrors * longest + float(tilt);
}

}  // namespace

TriangleMesh::TriangleMesh(Arrays arrays)
    : second_uvs_(std::move(arrays.second_uvs)), colors_(std::move(arrays.colors)),
      alphas_(std::move(arrays.alphas)), has_normals_(!arrays.normals.empty()),
      has_uvs_(!arrays.uvs.empty()) {
    faces_.reserve(arrays.triangles.size());
    for (const Triangle& t : arrays.triangles) {
        const Vec3 a = arrays.positions[t[0]], b = arrays.positions[t[1]],
                   c = arrays.positions[t[2]];
        const EdgeProduct p(a, b, c);
        if (p.has_area()) faces_.push_back({t, p.normal(), triangle_slack(b - a, c - a)});
    }
    arrays.triangles = {};
    vertices_.resize(arrays.positions.size());
    for (size_t i = 0; i < vertices_.size(); ++i)
        vertices_[i] = {arrays.positions[i], has_normals_ ? arrays.normals[i] : Vec3{},
                        has_uvs_ ? arrays.uvs[i] : Vec2{}};
    prefer_huge_pages(vertices_);
    prefer_huge_pages(faces_);
}

TriangleMesh::Arrays TriangleMesh::arrays() const {
    Arrays a{.second_uvs = second_uvs_, .colors = colors_, .alphas = alphas_};
    for (const Vertex& v : vertices_) {
        a.positions.push_back(v.p);
        if (has_normals_) a.normals.push_back(v.n);
        if (has_uvs_) a.uvs.push_back(v.uv);
    }
    for (const Face& f : faces_) a.triangles.push_back(f.vertices);
    return a;
}

Bounds3 TriangleMesh::bounds() const {
    Bounds3 b;
    for (const Vertex& v : vertices_) b.extend(v.p);
    return b;
}

double TriangleMesh::primitive_area(uint32_t prim) const {
    const auto [a, b, c] = faces_[prim].vertices;
    return 0.5 * EdgeProduct(vertices_[a].p, vertices_[b].p, vertices_[c].p).length;
}

double TriangleMesh::area() const {
    double sum = 0;
    for (uint32_t i = 0; i < faces_.size(); ++i) sum += primitive_area(i);
    return sum;
}

namespace {

/// The root of a t² - 2 b t + c = 0 that is nearest to `near`; empty where there is none.
std::optional<double> nearest_root(double a, double b, double c, double near) {
    const double disc = b * b - a * c;
    if (!(a > 0 && disc >= 0)) return {};
    const double root = std::sqrt(disc), q = b < 0 ? b - root : b + root;
    const double t0 = q / a, t1 = q != 0 ? c / q : t0;
    return std::fabs(t0 - near) < std::fabs(t1 - near) ? t0 : t1;
}

/// A vector under the upper 3×3 part of `m`.
template <class V>
V transformed(const Transform::Matrix& m, V v) {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
            m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}
/// Column `i` of `m`.
Vec3d column(const Transform::Matrix& m, size_t i) {
    return {m[0][i], m[1][i], m[2][i]};
}

/// A ray in the space of a shape.
struct LocalRay {
    double o[3], d[3];
};
LocalRay local_ray(const Transform& to_local, Vec3 o, Vec3 d) {
    const Transform::Matrix& m = to_local.matrix();
    LocalRay r;
    for (int i = 0; i < 3; ++i) {
        r.o[i] = m[i][0] * o.x + m[i][1] * o.y + m[i][2] * o.z + m[i][3];
        r.d[i] = m[i][0] * d.x + m[i][1] * d.y + m[i][2] * d.z;
    }
    return r;
}

/// The origin of the world in a shape's own coordinates.
std::array<double, 3> origin_in(const Transform& to_local) {
    const Transform::Matrix& m = to_local.matrix();
    return {m[0][3], m[1][3], m[2][3]};
}

/// The image of a point under an affine transform, rounded once.
Vec3 rounded_point(const Transform& to_world, const std::array<double, 3>& p) {
    const Transform::Matrix& m = to_world.matrix();
    const auto component = [&](size_t i) {
        return float(m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3]);
    };
    return {component(0), component(1), component(2)};
}

/// a + u (b - a) + v (c - a), rounded once.
float interpolate(float a, float b, float c, double u, double v) {
    return float(a + u * (double(b) - a) + v * (double(c) - a));
}
Vec3 interpolate(Vec3 a, Vec3 b, Vec3 c, float u, float v) {
    return {interpolate(a.x, b.x, c.x, u, v), interpolate(a.y, b.y, c.y, u, v),
            interpolate(a.z, b.z, c.z, u, v)};
}

/// The mean of the texture coordinates of three vertices, with weights of type `T`.
template <class V, class T>
V mean_of(Vec2 a, Vec2 b, Vec2 c, T u, T v) {
    const T w = 1 - u - v;
    return {a.x * w + b.x * u + c.x * v, a.y * w + b.y * u + c.y * v};
}

/// ∂p/∂u and ∂p/∂v of a triangle from its edges and their differences of texture coordinates; zero where these are parallel.
template <class V>
std::pair<V, V> tangents_of(V e1, V e2, Vec2 d1, Vec2 d2) {
    const float det = d1.x * d2.y - d1.y * d2.x;
    if (det == 0) return {};
    const float inv = 1 / det;
    return {(e1 * d2.y - e2 * d1.y) * inv, (e2 * d1.x - e1 * d2.x) * inv};
}

/// Barycentric coordinates of a point `p` of the plane, relative to the first vertex; `n`: cross product of the edges.
struct Barycentric {
    double u, v;

    Barycentric(Vec3d p, Vec3d e1, Vec3d e2, Vec3d n)
        : u(dot(cross(p, e2), n) / dot(n, n)), v(dot(cross(e1, p), n) / dot(n, n)) {}
};

}  // namespace

SurfaceGeometry TriangleMesh::surface(uint32_t prim, float u, float v, bool tangents) const {
    const Face& face = faces_[prim];
    const uint32_t ia = face.vertices[0], ib = face.vertices[1], ic = face.vertices[2];
    const Vertex &a = vertices_[ia], &b = vertices_[ib], &c = vertices_[ic];
    const Vec3 e1 = b.p - a.p, e2 = c.p - a.p;
    const float w = 1 - u - v;
    SurfaceGeometry g;
    g.p = interpolate(a.p, b.p, c.p, u, v);
    g.slack = face.slack;
    g.ng = face.ng;
    g.ns = g.ng;
    if (has_normals_) {
        const Vec3 n = a.n * w + b.n * u + c.n * v;
        const float len2 = length2(n);
        if (len2 > 0) {
            g.ns = n * (1.0f / std::sqrt(len2));
            g.ng = turned(face.ng, g.ns);
        }
    }
    if (!colors_.empty()) g.color = colors_[ia] * w + colors_[ib] * u + colors_[ic] * v;
    if (!alphas_.empty()) g.alpha = alphas_[ia] * w + alphas_[ib] * u + alphas_[ic] * v;
    if (!second_uvs_.empty())
        g.second_uv = mean_of<Vec2>(second_uvs_[ia], second_uvs_[ib], second_uvs_[ic], u, v);
    if (!has_uvs_) {
        g.uv = {u, v};
        if (tangents) g.dpdu = e1, g.dpdv = e2;
        return g;
    }
    g.uv = mean_of<Vec2>(a.uv, b.uv, c.uv, u, v);
    if (tangents) std::tie(g.dpdu, g.dpdv) = tangents_of(e1, e2, b.uv - a.uv, c.uv - a.uv);
    return g;
}

std::optional<SurfaceJet> TriangleMesh::jet(uint32_t prim, Vec3d o, Vec3d d, double) const {
    const Face& face = faces_[prim];
    const Vertex &a = vertices_[face.vertices[0]], &b = vertices_[face.vertices[1]],
                 &c = vertices_[face.vertices[2]];
    const Vec3d pa(a.p), e1 = Vec3d(b.p) - pa, e2 = Vec3d(c.p) - pa, n = cross(e1, e2);
    const double slope = dot(d, n);
    if (slope == 0) return {};
    const Vec3d p = o + d * (dot(pa - o, n) / slope);
    SurfaceJet j{
        .p = p, .ng = normalize(n), .ns = {}, .dpdu = e1, .dpdv = e2, .dnsdu = {}, .dnsdv = {}};
    j.ns = j.ng;
    if (!has_normals_) return j;
    const Barycentric at(p - pa, e1, e2, n);
    const Vec3d na(a.n), f1 = Vec3d(b.n) - na, f2 = Vec3d(c.n) - na, m = na + f1 * at.u + f2 * at.v;
    const double size = length(m);
    if (!(size > 0)) return j;
    j.ns = m / size;
    if (dot(j.ng, j.ns) < 0) j.ng = -j.ng;
    j.dnsdu = (f1 - j.ns * dot(j.ns, f1)) / size;
    j.dnsdv = (f2 - j.ns * dot(j.ns, f2)) / size;
    return j;
}

TextureJet TriangleMesh::texture_jet(uint32_t prim, const SurfaceJet& at) const {
    const auto [ia, ib, ic] = faces_[prim].vertices;
    const Vertex &a = vertices_[ia], &b = vertices_[ib], &c = vertices_[ic];
    const Vec3d &e1 = at.dpdu, &e2 = at.dpdv;
    const Barycentric bary(at.p - Vec3d(a.p), e1, e2, cross(e1, e2));
    const Dual u(bary.u, 1, 0), v(bary.v, 0, 1);
    TextureJet t;
    if (!second_uvs_.empty())
        t.second_uv = mean_of<Vec2Dual>(second_uvs_[ia], second_uvs_[ib], second_uvs_[ic], u, v);
    if (!has_uvs_) return {{u, v}, t.second_uv, e1, e2};
    t.uv = mean_of<Vec2Dual>(a.uv, b.uv, c.uv, u, v);
    std::tie(t.dpdu, t.dpdv) = tangents_of(e1, e2, b.uv - a.uv, c.uv - a.uv);
    return t;
}

ShapeSample TriangleMesh::sample(uint32_t prim, Vec2 u) const {
    const Vec2 at = sample_uniform_triangle(u);
    const Face& face = faces_[prim];
    const Vertex &a = vertices_[face.vertices[0]], &b = vertices_[face.vertices[1]],
                 &c = vertices_[face.vertices[2]];
    const Vec3 n = a.n * (1 - at.x - at.y) + b.n * at.x + c.n * at.y;
    return {interpolate(a.p, b.p, c.p, at.x, at.y), has_normals_ ? turned(face.ng, n) : face.ng, at,
            prim, face.slack};
}

size_t TriangleMesh::memory_bytes() const {
    return vertices_.size() * sizeof(Vertex) + faces_.size() * sizeof(Face) +
           second_uvs_.size() * sizeof(Vec2) + colors_.size() * sizeof(Vec3) +
           alphas_.size() * sizeof(float);
}

// ---- Sphere

namespace {

/// The azimuth of (x, y) over 2π, in [0, 1].
template <class T>
T turns(T x, T y) {
    using std::atan2;
    const T phi = atan2(y, x);
    return (phi < 0 ? phi + 2 * kPi : phi) / (2 * kPi);
}

/// Texture coordinates of an analytic shape and their tangents, in its own space.
template <class V, class UV>
struct Parametrisation {
    UV uv;
    V along_u, along_v;
};

/// Of the unit sphere where its normal is `n`.
template <class UV, class V>
Parametrisation<V, UV> on_sphere(V n) {
    using std::atan2, std::hypot;
    using T = decltype(n.x);
    const T sine = hypot(n.x, n.y);
    // At a pole, where every azimuth is as good, that of 0.
    const UV azimuth = sine > 0 ? UV{n.x / sine, n.y / sine} : UV{1, 0};
    return {{turns(n.x, n.y), atan2(sine, n.z) / kPi},
            {-n.y, n.x, 0},
            {n.z * azimuth.x, n.z * azimuth.y, -sine}};
}

/// Of the unit disc at (x, y), whose distance from the centre is `radius`.
template <class V, class UV, class T>
Parametrisation<V, UV> on_disk(T x, T y, T radius) {
    const T c = radius > 0 ? x / radius : T(1), s = radius > 0 ? y / radius : T(0);
    return {{std::min(radius, T(1)), turns(c, s)}, {c, s, 0}, {-s, c, 0}};
}

}  // namespace

Sphere::Sphere(Vec3 center, float radius, bool flip_normals)
    : center_(center), radius_(radius), flip_(flip_normals) {
    choose_axes();
}

Sphere::Sphere(const Transform& to_world, bool flip_normals) : flip_(flip_normals) {
    center_ = to_world.point({0, 0, 0});
    radius_ = length(to_world.vector({1, 0, 0}));
    Transform::Matrix m = to_world.matrix();
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) m[i][j] /= radius_;
        m[i][3] = 0;
    }
    orientation_ = Transform(m);
    to_local_ = orientation_.inverse();
    choose_axes();
}

void Sphere::choose_axes() {
    const double cx = center_.x, cy = center_.y, cz = center_.z,
                 distance = std::sqrt(cx * cx + cy * cy + cz * cz);
    const Direction z = distance > 0 ? Direction{-cx / distance, -cy / distance, -cz / distance}
                                     : Direction{0, 0, 1};
    // [Duff et al. 2017]
    const double sign = std::copysign(1.0, z.z), a = -1 / (sign + z.z), b = z.x * z.y * a;
    axes_ = {
        {{1 + sign * z.x * z.x * a, sign * b, -sign * z.x}, {b, sign + z.y * z.y * a, -z.y}, z}};
    // The error of intersections in double.
    constexpr double kErrors = 0x1p-49;
    slack_ = float(kErrors * (distance + radius_));
}

Bounds3 Sphere::bounds() const {
    const Vec3 r{radius_, radius_, radius_};
    return {center_ - r, center_ + r};
}

double Sphere::area() const {
    return 4 * std::numbers::pi * double(radius_) * radius_;
}

SurfaceGeometry Sphere::at(const Direction& v) const {
    const auto& [s, t, w] = axes_;
    const double x = v.x * s.x + v.y * t.x + v.z * w.x, y = v.x * s.y + v.y * t.y + v.z * w.y,
                 z = v.x * s.z + v.y * t.z + v.z * w.z,
                 to_unit = 1 / std::sqrt(x * x + y * y + z * z), to_surface = radius_ * to_unit;
    SurfaceGeometry g;
    g.p = {float(center_.x + to_surface * x), float(center_.y + to_surface * y),
           float(center_.z + to_surface * z)};
    g.slack = slack_;
    const Vec3 n{float(x * to_unit), float(y * to_unit), float(z * to_unit)};
    g.ng = g.ns = flip_ ? -n : n;
    return g;
}

SurfaceGeometry Sphere::surface(uint32_t, float u, float v, bool tangents) const {
    double sp, cp, st, ct;
    sincos(2 * std::numbers::pi * u, &sp, &cp);
    sincos(std::numbers::pi * v, &st, &ct);
    SurfaceGeometry g = at({st * cp, st * sp, ct});
    const Vec3 n = to_local_.vector(flip_ ? -g.ng : g.ng);
    const auto here = on_sphere<Vec2>(n);
    g.uv = here.uv;
    if (tangents) {
        g.dpdu = orientation_.vector(here.along_u) * (2 * kPi * radius_);
        g.dpdv = orientation_.vector(here.along_v) * (kPi * radius_);
    }
    return g;
}

std::optional<SurfaceJet> Sphere::jet(uint32_t, Vec3d o, Vec3d d, double near) const {
    const Vec3d v = Vec3d(center_) - o;
    const double r = double(radius_);
    const auto t = nearest_root(dot(d, d), dot(v, d), dot(v, v) - r * r, near);
    if (!t) return {};
    const double side = flip_ ? -1 : 1;
    const Vec3d n = (d * *t - v) / r;
    const TangentBasis tangents(normalize(n));
    return SurfaceJet{.p = o + d * *t,
                      .ng = n * side,
                      .ns = n * side,
                      .dpdu = tangents.s * r,
                      .dpdv = tangents.t * r,
                      .dnsdu = tangents.s * side,
                      .dnsdv = tangents.t * side};
}

TextureJet Sphere::texture_jet(uint32_t, const SurfaceJet& at) const {
    const Vec3Dual n(at.ns, at.dnsdu, at.dnsdv);
    const auto here = on_sphere<Vec2Dual>(transformed(to_local_.matrix(), flip_ ? -n : n));
    const Transform::Matrix& m = orientation_.matrix();
    return {here.uv,
            {},
            transformed(m, here.along_u) * double(2 * kPi * radius_),
            transformed(m, here.along_v) * double(kPi * radius_)};
}

ShapeSample Sphere::sample(uint32_t, Vec2 u) const {
    const Vec3 local = sample_uniform_sphere(u);
    const SurfaceGeometry g = at({local.x, local.y, local.z});
    return {g.p, g.ng, parameters(local), 0, g.slack};
}

std::optional<Sphere::Seen> Sphere::seen(Vec3 from) const {
    constexpr double kFarthestOnSurface = 1 + 1e-4;  // of squared distances, relative to the radius
    const Vec3d v = Vec3d(from) - Vec3d(center_);
    const double d2 = dot(v, v), r2 = double(radius_) * double(radius_);
    if (flip_ || !(d2 > r2 * kFarthestOnSurface)) return {};
    const double sine2 = r2 / d2;
    return Seen{v / std::sqrt(d2), std::sqrt(sine2), sine2 / (1 + std::sqrt(1 - sine2))};
}

ShapeSample Sphere::sample_seen(uint32_t prim, Vec3 from, Vec2 u) const {
    const auto s = seen(from);
    if (!s) return sample(prim, u);
    // The direction at the angle θ from the centre meets the sphere at the angle α as seen from the centre.
    const double from_cosine = double(u.x) * s->one_minus_cosine,
                 sine2 = from_cosine * (2 - from_cosine), part2 = sine2 / (s->sine * s->sine),
                 cos_a = std::min(1.0, sine2 / s->sine +
                                           (1 - from_cosine) * std::sqrt(std::max(0.0, 1 - part2))),
                 sin_a = std::sqrt(1 - cos_a * cos_a);
    double sp, cp;
    sincos(2 * std::numbers::pi * double(u.y), &sp, &cp);
    const TangentBasis across(s->to_observer);
    const Vec3d n = s->to_observer * cos_a + across.s * (sin_a * cp) + across.t * (sin_a * sp);
    const auto along = [&](const Direction& axis) {
        return n.x * axis.x + n.y * axis.y + n.z * axis.z;
    };
    const Direction in_axes{along(axes_[0]), along(axes_[1]), along(axes_[2])};
    const SurfaceGeometry g = at(in_axes);
    return {g.p, g.ng,    parameters({float(in_axes.x), float(in_axes.y), float(in_axes.z)}),
            0,   g.slack, seen_density(prim, g.p, g.ng, from)};
}

float Sphere::seen_density(uint32_t, Vec3 p, Vec3 ng, Vec3 from) const {
    const auto s = seen(from);
    if (!s) return 1;
    const Vec3d v = Vec3d(from) - Vec3d(p);
    const double dist2 = dot(v, v), cosine = dot(Vec3d(ng), v) / std::sqrt(dist2);
    if (!(cosine > 0)) return 0;
    // 1 / (2π (1 - cos θ)) per solid angle, times |cos|/d², times 4πr².
    return float(2 * (sqr(double(radius_)) / dist2) / s->one_minus_cosine * cosine);
}

bool Sphere::intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const {
    const double ox = double(o.x) - center_.x, oy = double(o.y) - center_.y,
                 oz = double(o.z) - center_.z;
    const double dx = d.x, dy = d.y, dz = d.z;
    const double a = dx * dx + dy * dy + dz * dz;
    const double b = ox * dx + oy * dy + oz * dz;
    const double c = ox * ox + oy * oy + oz * oz - double(radius_) * radius_;
    const double disc = b * b - a * c;
    if (!(disc >= 0)) return false;
    // q is the numerator of larger magnitude, so that neither root suffers from cancellation.
    const double root = std::sqrt(disc);
    const double q = b < 0 ? -b + root : -b - root;
    double t0 = q / a, t1 = q != 0 ? c / q : -q / a;
    if (t0 > t1) std::swap(t0, t1);
    const double t = t0 > tmin ? t0 : t1;
    if (!(t > tmin && t < tmax)) return false;
    const double x = ox + t * dx, y = oy + t * dy, z = oz + t * dz;
    const auto component = [&](const Direction& axis) {
        return float((x * axis.x + y * axis.y + z * axis.z) / radius_);
    };
    hit = {t, {component(axes_[0]), component(axes_[1]), component(axes_[2])}};
    return true;
}

Vec2 Sphere::parameters(Vec3 n) const {
    // Near the poles of a large sphere, acos(n.z) would be far from the point.
    return {turns(n.x, n.y), std::atan2(std::hypot(n.x, n.y), n.z) / kPi};
}

// ---- Disk

Disk::Disk(const Transform& to_world, bool flip_normals)
    : to_world_(to_world), to_local_(to_world.inverse()) {
    ng_ = normalize(to_world.normal({0, 0, 1}));
    if (flip_normals) ng_ = -ng_;
    const std::array<double, 3> origin = origin_in(to_local_);
    const double to_rim = 1 / std::max(1.0, std::hypot(origin[0], origin[1]));
    near_ = {origin[0] * to_rim, origin[1] * to_rim};
}

Bounds3 Disk::bounds() const {
    // The ellipse's extent along an axis is the length of that row of the linear part.
    const Vec3 c = to_world_.point({0, 0, 0}), x = to_world_.vector({1, 0, 0}),
               y = to_world_.vector({0, 1, 0});
    const Vec3 e{std::hypot(x.x, y.x), std::hypot(x.y, y.y), std::hypot(x.z, y.z)};
    return {c - e, c + e};
}

double Disk::area() const {
    return std::numbers::pi *
           EdgeProduct({}, to_world_.vector({1, 0, 0}), to_world_.vector({0, 1, 0})).length;
}

SurfaceGeometry Disk::surface(uint32_t, float u, float v, bool tangents) const {
    const double x = near_[0] + double(u), y = near_[1] + double(v);
    const float radius = float(std::hypot(x, y));
    const auto here = on_disk<Vec3, Vec2>(float(x), float(y), radius);
    SurfaceGeometry g;
    g.p = rounded_point(to_world_, {x, y, 0});
    g.ng = g.ns = ng_;
    g.uv = here.uv;
    if (tangents) {
        g.dpdu = to_world_.vector(here.along_u);
        g.dpdv = to_world_.vector(here.along_v) * (2 * kPi * radius);
    }
    return g;
}

std::optional<SurfaceJet> Disk::jet(uint32_t, Vec3d o, Vec3d d, double) const {
    const Transform::Matrix& m = to_world_.matrix();
    const Vec3d e1 = column(m, 0), e2 = column(m, 1), n = cross(e1, e2);
    const double slope = dot(d, n);
    if (slope == 0) return {};
    const Vec3d unit = normalize(n) * (dot(n, Vec3d(ng_)) < 0 ? -1 : 1);
    return SurfaceJet{.p = o + d * (dot(column(m, 3) - o, n) / slope),
                      .ng = unit,
                      .ns = unit,
                      .dpdu = e1,
                      .dpdv = e2,
                      .dnsdu = {},
                      .dnsdv = {}};
}

TextureJet Disk::texture_jet(uint32_t, const SurfaceJet& at) const {
    const Transform::Matrix &m = to_world_.matrix(), &inv = to_local_.matrix();
    const Vec3d local = transformed(inv, at.p) + column(inv, 3);
    const Dual x(local.x, 1, 0), y(local.y, 0, 1), radius = hypot(x, y);
    const auto here = on_disk<Vec3Dual, Vec2Dual>(x, y, radius);
    return {here.uv,
            {},
            transformed(m, here.along_u),
            transformed(m, here.along_v) * (2 * kPi * radius)};
}

ShapeSample Disk::sample(uint32_t, Vec2 u) const {
    const Vec2 d = sample_uniform_disk(u);
    const Vec2 at{float(d.x - near_[0]), float(d.y - near_[1])};
    return {surface(0, at.x, at.y, false).p, ng_, at, 0};
}

bool Disk::intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const {
    const auto [lo, ld] = local_ray(to_local_, o, d);
    if (ld[2] == 0) return false;
    const double t = -lo[2] / ld[2];
    if (!(t > tmin && t < tmax)) return false;
    const double x = lo[0] + t * ld[0], y = lo[1] + t * ld[1];
    if (!(x * x + y * y <= 1)) return false;
    hit = {t, {float(x - near_[0]), float(y - near_[1]), 0}};
    return true;
}

Vec2 Disk::parameters(Vec3 local) const {
    return {local.x, local.y};
}

Vec2 Disk::grid_parameters(Vec2 in_square) const {
    double s, c;
    sincos(2 * std::numbers::pi * in_square.y, &s, &c);
    return {float(in_square.x * c - near_[0]), float(in_square.x * s - near_[1])};
}

// ---- Cylinder

Cylinder::Cylinder(const Transform& to_world, bool flip_normals)
    : to_world_(to_world), to_local_(to_world.inverse()), flip_(flip_normals) {
    radius_ = length(to_world.vector({1, 0, 0}));
    height_ = length(to_world.vector({0, 0, 1}));
    const std::array<double, 3> origin = origin_in(to_local_);
    const double distance = std::hypot(origin[0], origin[1]);
    near_ = {1, 0, std::clamp(origin[2], 0.0, 1.0)};
    if (distance > 0) near_[0] = origin[0] / distance, near_[1] = origin[1] / distance;
}

Bounds3 Cylinder::bounds() const {
    const Vec3 x = to_world_.vector({1, 0, 0}), y = to_world_.vector({0, 1, 0});
    const Vec3 e{std::hypot(x.x, y.x), std::hypot(x.y, y.y), std::hypot(x.z, y.z)};
    Bounds3 b;
    for (float z : {0.0f, 1.0f}) {
        const Vec3 c = to_world_.point({0, 0, z});
        b.extend(c - e);
        b.extend(c + e);
    }
    return b;
}

double Cylinder::area() const {
    return 2 * std::numbers::pi * radius_ * height_;
}

SurfaceGeometry Cylinder::surface(uint32_t, float u, float v, bool tangents) const {
    double s, c;
    sincos(2 * std::numbers::pi * u, &s, &c);
    const double x = near_[0] * c - near_[1] * s, y = near_[1] * c + near_[0] * s,
                 to_unit = 1 / std::sqrt(x * x + y * y), z = near_[2] + double(v);
    SurfaceGeometry g;
    g.p = rounded_point(to_world_, {x * to_unit, y * to_unit, z});
    const float fx = float(x), fy = float(y);
    const Vec3 n = normalize(to_world_.normal({fx, fy, 0}));
    g.ng = g.ns = flip_ ? -n : n;
    g.uv = {turns(fx, fy), float(z)};
    if (tangents) {
        g.dpdu = to_world_.vector({-fy, fx, 0}) * (2 * kPi);
        g.dpdv = to_world_.vector({0, 0, 1});
    }
    return g;
}

std::optional<SurfaceJet> Cylinder::jet(uint32_t, Vec3d o, Vec3d d, double near) const {
    const Transform::Matrix &m = to_world_.matrix(), &inv = to_local_.matrix();
    const Vec3d lo = transformed(inv, o) + column(inv, 3), ld = transformed(inv, d);
    const auto t = nearest_root(ld.x * ld.x + ld.y * ld.y, -(lo.x * ld.x + lo.y * ld.y),
                                lo.x * lo.x + lo.y * lo.y - 1, near);
    if (!t) return {};
    const double x = lo.x + *t * ld.x, y = lo.y + *t * ld.y;
    // The transform has no shear, and scales x and y alike.
    const Vec3d n = column(m, 0) * x + column(m, 1) * y, dn = column(m, 1) * x - column(m, 0) * y;
    const double size = flip_ ? -length(n) : length(n);
    return SurfaceJet{.p = o + d * *t,
                      .ng = n / size,
                      .ns = n / size,
                      .dpdu = dn,
                      .dpdv = column(m, 2),
                      .dnsdu = dn / size,
                      .dnsdv = {}};
}

TextureJet Cylinder::texture_jet(uint32_t, const SurfaceJet& at) const {
    const Transform::Matrix &m = to_world_.matrix(), &inv = to_local_.matrix();
    const Vec3d local = transformed(inv, at.p) + column(inv, 3);
    const Dual x(local.x, -local.y, 0), y(local.y, local.x, 0), z(local.z, 0, 1);
    return {{turns(x, y), z},
            {},
            transformed(m, Vec3Dual(-y, x, 0)) * double(2 * kPi),
            transformed(m, Vec3Dual(0, 0, 1))};
}

ShapeSample Cylinder::sample(uint32_t, Vec2 u) const {
    const Vec2 at = grid_parameters(u);
    const SurfaceGeometry g = surface(0, at.x, at.y, false);
    return {g.p, g.ng, at, 0};
}

bool Cylinder::intersect(Vec3 o, Vec3 d, float tmin, float tmax, Hit& hit) const {
    const auto [lo, ld] = local_ray(to_local_, o, d);
    const double a = ld[0] * ld[0] + ld[1] * ld[1];
    const double b = lo[0] * ld[0] + lo[1] * ld[1];
    const double c = lo[0] * lo[0] + lo[1] * lo[1] - 1;
    const double disc = b * b - a * c;
    if (!(a > 0) || !(disc >= 0)) return false;
    const double root = std::sqrt(disc);
    const double q = b < 0 ? -b + root : -b - root;
    double roots[2] = {q / a, q != 0 ? c / q : -q / a};
    if (roots[0] > roots[1]) std::swap(roots[0], roots[1]);
    for (double t : roots) {
        const double z = lo[2] + t * ld[2];
        if (!(t > tmin && t < tmax && z >= 0 && z <= 1)) continue;
        const double x = lo[0] + t * ld[0], y = lo[1] + t * ld[1];
        hit = {t,
               {float(x * near_[0] + y * near_[1]), float(y * near_[0] - x * near_[1]),
                float(z - near_[2])}};
        return true;
    }
    return false;
}

Vec2 Cylinder::parameters(Vec3 local) const {
    return {std::atan2(local.y, local.x) / (2 * kPi), local.z};
}

Vec2 Cylinder::grid_parameters(Vec2 in_square) const {
    return {in_square.x, float(in_square.y - near_[2])};
}

}  // namespace etendue
