#pragma once
// What perturbations share: how far they go, and directions that change by a small angle.

#include "mcmc/mutation/mutation.h"

namespace etendue {

/// Lengths, or angles, whose logarithm is uniform between two bounds.
struct LogRange {
    float low, high;
    float sample(float u) const;
    bool contains(float r) const { return r >= low && r <= high; }
};

/// Pixels by which a film point moves [Veach 1997, §11.4.2]: from a tenth of one to √(0.05 A/π), A being the film's area.
LogRange film_range(const PathMeasure& measure);

/// `axis` turned by `angle` toward the azimuth of `u`.
Vec3 turned(Vec3 axis, float angle, float u);

/// The delta event of the same kind as that at `like`, from the last vertex of a walk; empty where there is none.
std::optional<BsdfSample> follow(const Vertex& at, const Vertex& like, TransportMode mode);

}  // namespace etendue
