// Samples of a mixture follow its probability mass function exactly, and every vertex can be sampled.

#include "reuse/importance_records.h"

#include <gtest/gtest.h>

#include "random.h"

namespace etendue {
namespace {

Vertex place(Vec3 p, Vec3 n = {0, 0, 1}, Vec3 wo = {0, 0, 1}) {
    Vertex v;
    v.p = p;
    v.ng = n;
    v.wo = wo;
    return v;
}

std::vector<float> cdf_of(std::vector<float> masses) {
    EXPECT_TRUE(to_cdf(masses));
    return masses;
}

TEST(ToCdf, FailsWithoutMass) {
    std::vector<float> none(5, 0.0f);
    EXPECT_FALSE(to_cdf(none));
}

/// Equally spaced numbers fall to a vertex as often as its pmf says, up to one at each end of the intervals they meet.
TEST(VertexMixture, SamplesItsPmf) {
    constexpr uint32_t kVertices = 200, kDraws = 1 << 22;
    testing::Random random(3);
    VertexMixture mixture(kVertices);
    std::vector<std::vector<float>> cdfs;
    for (int part = 0; part < 3; ++part) {
        std::vector<float> masses(kVertices);
        for (float& m : masses) {
            const float u = random.next_1d();
            m = u < 0.3f ? 0.0f : std::pow(u, 20.0f);  // over many orders of magnitude
        }
        cdfs.push_back(cdf_of(masses));
    }
    const double weights[] = {0.5, 0.3, 0.15};
    for (int part = 0; part < 3; ++part) mixture.add(cdfs[size_t(part)].data(), weights[part]);

    std::vector<uint32_t> drawn(kVertices);
    for (uint32_t i = 0; i < kDraws; ++i) {
        const auto [vertex, pmf] = mixture.sample((i + 0.5) / kDraws);
        ASSERT_LT(vertex, kVertices);
        ASSERT_EQ(pmf, mixture.pmf(vertex));
        ++drawn[vertex];
    }
    double sum = 0;
    for (uint32_t v = 0; v < kVertices; ++v) {
        EXPECT_GE(mixture.pmf(v), 0.05 / kVertices * (1 - 1e-9));
        EXPECT_NEAR(drawn[v], mixture.pmf(v) * kDraws, 4.01);
        sum += mixture.pmf(v);
    }
    EXPECT_NEAR(sum, 1, 1e-12);
}

TEST(VertexMixture, EndsOfTheRange) {
    const std::vector<float> cdf = cdf_of({0, 1, 0, 2, 0});
    VertexMixture all(5);
    all.add(cdf.data(), 1);
    EXPECT_EQ(all.sample(0).vertex, 1u);
    EXPECT_EQ(all.sample(0x1.fffffffffffffp-1).vertex, 3u);
    const VertexMixture uniform(5);
    EXPECT_EQ(uniform.sample(0).vertex, 0u);
    EXPECT_EQ(uniform.sample(0x1.fffffffffffffp-1).vertex, 4u);
    EXPECT_EQ(uniform.pmf(2), 0.2);
}

TEST(ImportanceRecords, MixNearbySimilarRecords) {
    ImportanceRecords records;
    std::vector<ImportanceRecords::Chunk> chunks(2);
    const auto add = [](ImportanceRecords::Chunk& chunk, const Vertex& z,
                        std::vector<float> masses) { chunk.add(z, masses); };
    add(chunks[0], place({0, 0, 0}), {1, 0, 0, 0});
    add(chunks[0], place({0, 0, 0}, {0, 0, -1}), {0, 1, 0, 0});  // the other side
    add(chunks[1], place({1, 0, 0}), {0, 0, 1, 0});
    add(chunks[1], place({0, 0, 0.1f}), {0, 0, 0, 0});  // has no mass
    records.assemble(chunks, 4);
    EXPECT_EQ(records.size(), 3u);

    const VertexMixture near = records.mixture(place({0.2f, 0, 0}), 6, 0.1);
    EXPECT_GT(near.pmf(0), near.pmf(2));
    EXPECT_GT(near.pmf(2), 0.1);
    EXPECT_NEAR(near.pmf(0) + near.pmf(2), 0.95, 1e-9);
    EXPECT_NEAR(near.pmf(1), 0.025, 1e-9);
    EXPECT_NEAR(near.pmf(3), 0.025, 1e-9);
    // No record has such a direction.
    EXPECT_EQ(records.mixture(place({0, 0, 0}, {1, 0, 0}), 6, 0.1).pmf(3), 0.25);
    // A record at distance 0 does not suppress the others.
    EXPECT_GT(records.mixture(place({0, 0, 0}), 6, 0.1).pmf(2), 0.03);

    records.assemble({}, 4);
    EXPECT_EQ(records.mixture(place({0, 0, 0}), 6, 0.1).pmf(1), 0.25);
}

}  // namespace
}  // namespace etendue
