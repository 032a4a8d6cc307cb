#pragma once
// The weight of a merge by the distance of its vertices.

#include "math/vec.h"

namespace etendue {

/// The kernel (9 - 9/2 x)/(7 π r²), where x = d²/(reach r)² for two vertices at a distance d. Its integral over the plane
/// is 1, and the integral of its square is 1/(π r²): the variance of merges is that of a disc with radius r. The mean of
/// d² is 0.46 r², for the disc 0.5 r², so that the image is less blurred. The kernel without the factor ½ at x,
/// Epanechnikov's, has 0.44 r², but reaches 1.15 r and needs a third more merges.
struct MergeKernel {
    static constexpr float kReach = 1.0183502f;  ///< √(28/27).

    /// The kernel at the squared distance `d2`, times π r². 0 beyond its reach.
    static float weight(float d2, float r) {
        const float x = d2 / sqr(kReach * r);
        return x < 1 ? (9 - 4.5f * x) / 7 : 0;
    }
};

}  // namespace etendue
