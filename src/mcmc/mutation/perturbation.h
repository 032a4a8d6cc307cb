#pragma once
// Shared by the perturbations: distances, and directions that are turned by a small angle.

#include "mcmc/mutation/mutation.h"

namespace etendue {

/// Distances or angles whose logarithm is uniformly distributed between two bounds.
struct LogRange {
    float low, high;
    float sample(float u) const;
    bool contains(float r) const { return r >= low && r <= high; }
};

/// Distances in pixels by which a film point moves [Veach 1997, §11.4.2]: from 1 to √(0.005 A/π), with the film's area A.
/// Veach has 0.1 and 0.05; but most moves of less than a pixel only repeat what the pixel has, and long ones are rejected.
LogRange film_range(const PathMeasure& measure);

/// `axis` turned by `angle` (radians) toward the azimuth 2π u.
Vec3 turned(Vec3 axis, float angle, float u);

/// The delta event at `at` that has the same kind as the one at `like`; empty if there is none.
std::optional<BsdfSample> follow(const Vertex& at, const Vertex& like, TransportMode mode);

}  // namespace etendue
