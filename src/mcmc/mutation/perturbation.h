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

/// An event in a given direction. It needs no densities, since Q is computed from the finished path.
BsdfSample given(Vec3 wi);

/// Events that a perturbation repeats at the new place of a vertex.
enum class Followed {
    Delta,
    Glossy  ///< Delta events and glossy reflections: these keep their half vector [Kaplanyan et al. 2014].
};

/// Whether the event at x_i is one of these.
bool is_followed(const PathState& x, int i, Followed events);
/// Whether the same event, or none, is followed at x_i and y_i.
bool is_same_event(const PathState& x, const PathState& y, int i, Followed events);
/// Repeats the followed event of x_i at `at`; empty if there is none.
std::optional<BsdfSample> follow(const Vertex& at, const PathState& x, int i, TransportMode mode);
/// Density of x_{i-1} (Radiance) or x_{i+1} (Importance) after the followed event at x_i, if half vectors have density 1 per
/// steradian.
double followed_density(const PathState& x, int i, TransportMode mode);

}  // namespace etendue
