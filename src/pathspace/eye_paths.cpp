#include "pathspace/eye_paths.h"

#include <array>

namespace etendue {

void trace_eye_paths(const WalkContext& walk, std::span<const SampleContext> c,
                     std::span<SubPath> z) {
    std::array<WalkInTurn, kMostWalksInTurn> walks;
    for (size_t i = 0; i < c.size(); ++i) {
        Sampler& sampler = c[i].sampler;
        walks[i].sampler = &sampler;
        walks[i].path = &z[i];
        sampler.seek(Stream::Eye, 0);
        const Film::PixelSample at = c[i].film_sample(sampler.next_2d_if(c[i].needs_film_number()));
        const Vec2 u_lens = sampler.next_2d_if(walk.scene.sensor().has_finite_lens());
        start_eye_path_in_turn(walk, at, u_lens, walks[i]);
    }
    const std::span all(walks.data(), c.size());
    walk_in_turns<TransportMode::Radiance>(walk, all);
    if (c.size() > 1 && walk.counts.next_event > 0) fetch_next_events(walk.scene, all);
}

}  // namespace etendue
