#include "pathspace/eye_paths.h"

#include <array>
#include <cassert>

namespace etendue {
namespace {

/// Where the eye path of a sample starts.
struct EyeStart {
    Film::PixelSample at;
    SensorRay ray;

    explicit EyeStart(const SampleContext& c)
        : at(film_sample(c)),
          ray(c.scene.sensor().sample_ray(
              at.point, c.sampler.next_2d_if(c.scene.sensor().has_finite_lens()))) {}

private:
    static Film::PixelSample film_sample(const SampleContext& c) {
        c.sampler.seek(Stream::Eye, 0);
        return c.film_sample(c.sampler.next_2d_if(c.needs_film_number()));
    }
};

}  // namespace

void trace_eye_path(const WalkContext& walk, const SampleContext& c, SubPath& z) {
    const EyeStart start(c);
    Step step;
    begin_eye_path(walk, start.at, start.ray, c.sampler, z, step);
    walk_on<TransportMode::Radiance>(walk, c.sampler, z, step);
}

void trace_eye_paths(const WalkContext& walk, std::span<const SampleContext> c,
                     std::span<SubPath> z) {
    if (c.size() == 1) return trace_eye_path(walk, c[0], z[0]);
    assert(c.size() <= kWalksInTurn && c.size() == z.size());
    std::array<WalkInTurn, kWalksInTurn> walks;
    for (size_t i = 0; i < c.size(); ++i) {
        WalkInTurn& w = walks[i];
        w.sampler = &c[i].sampler;
        w.path = &z[i];
        const EyeStart start(c[i]);
        begin_eye_path(walk, start.at, start.ray, c[i].sampler, z[i], w.step);
    }
    const std::span all(walks.data(), c.size());
    walk_in_turns<TransportMode::Radiance>(walk, all);
    if (walk.counts.next_event > 0) prefetch_next_events(walk.scene, all);
}

}  // namespace etendue
