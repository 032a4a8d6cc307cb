#include "manifold/chain_ray.h"

namespace etendue {
namespace {

/// Derivative of the shading normal along the tangent vector `dp`.
Vec3d normal_derivative(const SurfaceJet& at, Vec3d dp) {
    // dp = u ∂p/∂u + v ∂p/∂v
    const double uu = dot(at.dpdu, at.dpdu), uv = dot(at.dpdu, at.dpdv), vv = dot(at.dpdv, at.dpdv),
                 pu = dot(dp, at.dpdu), pv = dot(dp, at.dpdv), det = uu * vv - uv * uv;
    if (!(det > 0)) return {};
    return at.dnsdu * ((pu * vv - pv * uv) / det) + at.dnsdv * ((pv * uu - pu * uv) / det);
}

}  // namespace

void ChainRay::arrive(const SurfaceJet& at) {
    const double t = dot(at.p - o, d), slope = dot(d, at.ng);
    o = at.p;
    way += t;
    const auto moved = [&](Vec3d dp, Vec3d dd) {
        const Vec3d v = dp + dd * t;
        return v - d * (dot(v, at.ng) / slope);
    };
    o1 = moved(o1, d1);
    o2 = moved(o2, d2);
}

void ChainRay::reflect(const SurfaceJet& at) {
    const Vec3d n = at.ns;
    const double c = dot(d, n);
    const auto reflected = [&](Vec3d dp, Vec3d dd) {
        const Vec3d dn = normal_derivative(at, dp);
        return dd - (n * (dot(dd, n) + dot(d, dn)) + dn * c) * 2;
    };
    d1 = reflected(o1, d1);
    d2 = reflected(o2, d2);
    d = normalize(d - n * (2 * c));
}

bool ChainRay::refract(const SurfaceJet& at, double eta) {
    if (eta == 1) return true;
    const double side = dot(d, at.ns) > 0 ? -1 : 1, k = 1 / eta;
    const Vec3d n = at.ns * side;
    const double c = -dot(d, n), C2 = 1 - k * k * (1 - c * c);
    if (!(C2 > 0)) return false;
    const double C = std::sqrt(C2), a = k * c - C;
    const auto refracted = [&](Vec3d dp, Vec3d dd) {
        const Vec3d dn = normal_derivative(at, dp) * side;
        const double dc = -dot(dd, n) - dot(d, dn), dC = k * k * c * dc / C;
        return dd * k + n * (k * dc - dC) + dn * a;
    };
    d1 = refracted(o1, d1);
    d2 = refracted(o2, d2);
    d = normalize(d * k + n * a);
    return true;
}

Passing passing(const ChainRay& r, Vec3d point) {
    const TangentBasis b(r.d);
    const Vec3d v = point - r.o;
    const double s = dot(v, r.d);
    const Vec3d v1 = r.o1 + r.d1 * s, v2 = r.o2 + r.d2 * s;
    return {.x = -dot(v, b.s),
            .y = -dot(v, b.t),
            .distance = s,
            .by_angles = {dot(v1, b.s), dot(v1, b.t), dot(v2, b.s), dot(v2, b.t)}};
}

Passing passing_at_infinity(const ChainRay& r, Vec3d to) {
    const TangentBasis b(r.d);
    return {.x = -dot(to, b.s),
            .y = -dot(to, b.t),
            .distance = dot(to, r.d) > 0 ? 1.0 : -1.0,
            .by_angles = {dot(r.d1, b.s), dot(r.d1, b.t), dot(r.d2, b.s), dot(r.d2, b.t)}};
}

}  // namespace etendue
