#pragma once
// The constants of gathers that were set by experiment. bench/gather-constants repeats the experiments: it builds the program
// with other values of one of them and compares errors and times.

namespace etendue {

struct GatherConstants {
    /// Half the height of a neighbourhood over its radius, with the bound `slab`: the directions that trials propose lie
    /// in a thin band then, and still include nearly all of a smooth surface.
    float flatness = 0.02f;
    /// The default radius: pairs that an eye path is to find, and the largest share of the radius of the scene's bounds.
    double pairs = 8;
    float largest_radius = 0.02f;
    /// ρ of PairDensity. Competing techniques share most of the eye path too, so it is far less than 1. Of 0.05, 0.2, 0.5
    /// and 1, 0.2 has the least errors on veach-ajar, staircase2, veach-bidir and living-room.
    double correlation = 0.2;
    /// The same of merges. More than 1, since a light path leaves several vertices where it is caught, and an eye path
    /// merges at several. Of 0.2, 1, 2, 5 and 20, 5 has nearly the least errors on scenes/ring.xml, glass-caustic, demo and
    /// lantern: 20 is better on ring, less on demo and lantern, which then have fewer outliers.
    double merge_correlation = 5;
    /// Survival of a pair, and of a search, over the root mean square of the ratio of contributions to their estimates. A
    /// factor of two in either hardly changes the error at equal time (the same four scenes).
    float pair_survival = 2, search_survival = 0.7f;
    /// A smaller scale of gathers' weights is chosen where it makes the second moment this many times smaller: a few bright
    /// pairs decide the moments of large scales.
    double clear_gain = 1.25;
};
inline constexpr GatherConstants kGatherConstants;

}  // namespace etendue
