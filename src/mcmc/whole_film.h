#pragma once
// The context in which states are evaluated: samples of the whole film, whose numbers and sink are the state's own.

#include "pathspace/sample_context.h"

namespace etendue {

class WholeFilm {
public:
    explicit WholeFilm(const PassContext& pass)
        : sample{.scene = pass.scene,
                 .film = pass.film,
                 .expected = pass.film.expected(),
                 .index = 0,
                 .chunk = 0,
                 .light_paths = pass.light_paths,
                 .splat_scale = 1 / float(pass.light_paths),
                 .sampler = sampler_,
                 .sink = sink_,
                 .is_of_whole_film = true} {}

private:
    class NoSink final : public ContributionSink {
        void add(const Join&, Rgb) override {}
    };
    NoSink sink_;
    Sampler sampler_{SamplerKind::Independent, 0};

public:
    const SampleContext sample;
};

}  // namespace etendue
