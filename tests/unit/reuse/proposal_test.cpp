// Thinning of proposed directions, with random numbers that the test chooses.

#include "reuse/proposal.h"

#include <cmath>

#include <gtest/gtest.h>

#include "test_scenes.h"

namespace etendue {
namespace {

/// Every number is the same.
struct Constant final : PrimarySource {
    explicit Constant(double u) : value(uint32_t(u * 0x1p32)) {}
    uint32_t bits(Stream, uint64_t, uint32_t) override { return value; }
    uint32_t value;
};

/// A proposal is kept with the probability density / bound, also if it is less than 2^-24.
TEST(Thinning, KeepsImprobableEventsAsRarelyAsItShould) {
    const Scene scene =
        test::build(test::front_camera(1) +
                    test::rectangle("<scale value=\"5\"/>", test::diffuse("0.5,0.5,0.5")));
    const Film film(scene.film(), scene.filter());
    const TechniqueCounts counts;
    RenderStats stats;
    SubPath z;
    Sampler start(SamplerKind::Independent, 1);
    start.start(0, 0);
    start_eye_path({scene, counts, stats, {3, 10}}, film, 0, start, z);
    ASSERT_EQ(z.size(), 2);
    const WalkDensity density{z[1], TransportMode::Radiance};
    const Vec3 up{0, 0, 1};
    const float pdf = density.pdf(up);
    ASSERT_GT(pdf, 0);
    for (const double share : {0x1p-20, 0x1p-27}) {
        const ConeProposal cone{.mass = 1,
                                .frame = Frame::from_normal(up),
                                .max_pdf = float(double(pdf) / share),
                                .one_minus_cos = 0};
        const auto is_kept = [&](double u) {
            Constant numbers(u);
            Sampler sampler(numbers);
            sampler.seek(Stream::Auxiliary, 0);
            return cone.propose(density, sampler, stats).has_value();
        };
        EXPECT_TRUE(is_kept(0.5 * share)) << share;
        EXPECT_FALSE(is_kept(2 * share)) << share;
    }
}

}  // namespace
}  // namespace etendue
