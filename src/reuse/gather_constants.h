#pragma once
// The constants of gathers that were set by experiment. bench/gather-constants repeats the experiments: it builds the program
// with other values of one of them and compares errors and times.

namespace etendue {

struct GatherConstants {
    /// Half the height of a neighbourhood, divided by its radius, for the bound `slab`. The directions that trials
    /// propose then lie in a thin band, and the neighbourhood still includes nearly all of a smooth surface.
    float flatness = 0.02f;
    /// Default radius of the first passes: the number of pairs that an eye path should find, and the upper limit relative
    /// to the radius of what the camera sees.
    double pairs = 8;
    /// Number of pairs that an eye path should find at vertices not fixed by the film point (Vertex). Of 4 and 16,
    /// 4 has the smaller error on yard-ring, two-rooms and staircase2, and 16 on veach-ajar.
    double inner_pairs = 4;
    float largest_first_radius = 0.02f;
    /// The same limit for later passes, and the largest factor between their number of pairs and that of the first ones.
    float largest_radius = 0.06f;
    double pairs_range = 16;
    /// Time of a light vertex in a search, and of a trial with its share of joins and rays, divided by that of a ray with
    /// its share of walks and joins. The former is from passes on yard-ring, the latter was fitted to 35 renderings of seven
    /// scenes.
    double candidate_time = 0.15, trial_time = 3.6;
    /// Time of one more next event at a vertex, in the same unit: 0.6 on yard-ring, 0.9 on living-room.
    double next_event_time = 0.7;
    /// Count of connections in the weights of methods that gather. A pixel has one connection for each pair of lengths,
    /// with its own light path, whereas pairs come from many light paths. Of 1, 0.5, 0.25 and 0.1 with the same samples,
    /// smaller values have less variance on yard-ring, staircase2, veach-ajar and two-rooms (up to 13 %), and slightly
    /// more on veach-bidir and lantern (up to 7 %).
    float connections = 0.25f;
    /// ρ of PairDensity. It is far below 1, because competing techniques also share most of the eye path. Of 0.05, 0.2,
    /// 0.5 and 1, the value 0.2 has the smallest errors on veach-ajar, staircase2, veach-bidir and living-room.
    double correlation = 0.2;
    /// ρ for merges. It exceeds 1, because a light path that is caught in a corner leaves several vertices there, and
    /// an eye path merges at several vertices. Of 0.2, 1, 2, 5 and 20, the value 5 has nearly the smallest errors on
    /// scenes/ring.xml, glass-caustic, demo and lantern. 20 is better on ring, and to a lesser degree on demo and
    /// lantern, which then have fewer outliers.
    double merge_correlation = 5;
    /// Part of the noise of roulette that systematic sampling of pairs leaves, since shadow rays may be blocked.
    double roulette_noise = 0.5;
    /// Survival probability of a pair, and of a search, divided by the root mean square of the ratio of contributions
    /// to their estimates. A factor of two in either value hardly changes the error at equal time (on the same four
    /// scenes).
    float pair_survival = 0.7f, search_survival = 0.7f;
    /// A smaller scale of the weights of gathers is chosen only if it reduces the second moment by this factor, because
    /// a few bright pairs determine the moments of large scales.
    double clear_gain = 1.25;
};
inline constexpr GatherConstants kGatherConstants;

}  // namespace etendue
