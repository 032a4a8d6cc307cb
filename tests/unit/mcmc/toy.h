#pragma once
// Small problems with exact answers for chains: samples that read a few numbers and put values into a few cells of the film.

#include <cmath>

#include "math/hash.h"
#include "mcmc/chain_groups.h"
#include "mcmc/primary_space.h"
#include "mcmc/whole_film.h"
#include "test_scenes.h"

namespace etendue::test {

inline constexpr int kCells = 8;

/// A cell is chosen by the first number; how many more are read depends on it, and so does what they are worth. Cell 6 is
/// rare and bright, the last cell is black.
inline void toy_sample(int, const SampleContext& c, Workspace& work) {
    work.z.film_weight = 1;
    c.sampler.seek(Stream::Eye, 0);
    const float u = c.sampler.next_1d();
    const int cell = std::min(int(u * kCells), kCells - 1);
    float value = float(1 + cell % 3);
    if (cell % 2 == 1) {  // mean 1/2 of the value
        c.sampler.seek(Stream::Light, uint64_t(cell));
        value *= c.sampler.next_1d();
    }
    if (cell == 6) {  // 40 times in a fiftieth of the cell
        c.sampler.seek(Stream::Light, 1);
        const Vec2 v = c.sampler.next_2d();
        value *= v.x < 0.1f && v.y < 0.2f ? 40.0f : 0.0f;
    }
    if (cell == kCells - 1) return;
    Join join{.technique = {Strategy::Splat, cell, 1},
              .emitter = nullptr,
              .contribution = Rgb(value),
              .mis_weight = 1,
              .film = {float(cell) + 0.5f, 0.5f}};
    c.sink.add(join, join.contribution);
}

/// What each cell receives of a sample in the mean.
inline std::array<double, kCells> toy_means() {
    std::array<double, kCells> means{};
    for (int i = 0; i + 1 < kCells; ++i)
        means[size_t(i)] =
            (1 + i % 3) * (i % 2 == 1 ? 0.5 : 1.0) * (i == 6 ? 40 * 0.02 : 1.0) / kCells;
    return means;
}
inline double toy_b() {
    double b = 0;
    for (const double v : toy_means()) b += v;
    return b;
}

/// Sums by cell.
class CellSums final : public SplatSink {
public:
    void add(Vec2 film, Rgb value) override { sums[size_t(film.x)] += double(value.r); }
    void tell(const Join&, Rgb, float) override {}
    std::array<double, kCells> sums{};
};

/// Passes over a film of kCells × 1 pixels, without threads.
class ToyPasses {
public:
    ToyPasses()
        : scene_(build(sensor("0,0,3", "0,0,0", kCells) + area_lamp())), geometry_{kCells, 1, 0, 0,
                                                                                   kCells, 1},
          film_(geometry_, filter_) {}

    const FilmGeometry& geometry() const { return geometry_; }
    PassContext pass(uint32_t index, uint64_t seed, uint64_t mutations, CellSums& sums) {
        return {.scene = scene_,
                .film = film_,
                .index = index,
                .light_paths = 1,
                .pixels = mutations,
                .seed = seed,
                .for_each_sample = {},
                .chunks = {},
                .for_each_other_path =
                    [this](uint64_t count, const PassContext::Task& task) {
                        Sampler sampler(SamplerKind::Independent, 0);
                        for (uint64_t i = 0; i < count; ++i) task(i, sampler, work_);
                    },
                .for_each_chain =
                    [this, &sums](uint64_t count, const PassContext::ChainTask& task) {
                        for (uint64_t i = 0; i < count; ++i) task(i, sums, work_);
                    }};
    }
    Workspace& work() { return work_; }

private:
    Scene scene_;
    FilmGeometry geometry_;
    ReconstructionFilter filter_ = ReconstructionFilter::box();
    Film film_;
    Workspace work_;
};

}  // namespace etendue::test
