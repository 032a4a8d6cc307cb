#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "guide/guide.h"
#include "math/frame.h"
#include "math/warp.h"
#include "random.h"
#include "state.h"

namespace etendue {
namespace {

using testing::Random;

constexpr auto kEye = TransportMode::Radiance, kLight = TransportMode::Importance;

/// Places on a floor, lit by a small lamp above, for eye walks; and directions without structure, for light walks.
std::vector<GuideSample> samples_under_lamp(int count) {
    const Vec3 lamp{0.2f, 0.3f, 1};
    Random random(3);
    std::vector<GuideSample> samples;
    for (int i = 0; i < count; ++i) {
        GuideSample s;
        const Vec2 at = random.next_2d();
        s.p = {at.x, at.y, 0};
        s.set_normal({0, 0, 1});
        const bool for_eye = i % 2 == 0;
        const Vec3 jitter = sample_uniform_sphere(random.next_2d());
        const Vec3 to =
            for_eye ? lamp + jitter * 0.01f - s.p : sample_cosine_hemisphere(random.next_2d());
        s.mode = uint8_t(for_eye ? kEye : kLight);
        s.inv_distance = for_eye ? 1 / length(to) : 0.0f;
        s.direction = PackedDirection(normalize(to));
        s.unguided_pdf = s.direction.unpack().z * kInvPi;
        s.set_flux(1);
        samples.push_back(s);
    }
    return samples;
}

/// As under a lamp on [x, x + size] × [0, size], for walks in `mode`; or without structure. All have the power `flux`.
void add_square(std::vector<GuideSample>& samples, int count, float x, float size,
                TransportMode mode, bool has_lamp, float flux, uint64_t seed) {
    Random random(seed);
    for (int i = 0; i < count; ++i) {
        GuideSample s;
        const Vec2 at = random.next_2d();
        s.p = {x + size * at.x, size * at.y, 0};
        s.set_normal({0, 0, 1});
        const Vec3 jitter = sample_uniform_sphere(random.next_2d());
        const Vec3 to =
            has_lamp ? Vec3{x + 0.5f * size, 0.5f * size, size} + jitter * (0.01f * size) - s.p
                     : sample_cosine_hemisphere(random.next_2d());
        s.mode = uint8_t(mode);
        s.inv_distance = has_lamp ? 1 / length(to) : 0.0f;
        s.direction = PackedDirection(normalize(to));
        s.unguided_pdf = s.direction.unpack().z * kInvPi;
        s.set_flux(flux);
        samples.push_back(s);
    }
}

TEST(PackedDirection, IsPrecise) {
    Random random(1);
    for (int i = 0; i < 10000; ++i) {
        const Vec3 w = sample_uniform_sphere(random.next_2d());
        const Vec3 v = PackedDirection(w).unpack();
        EXPECT_LT(length(v - w), 1e-4f);
        EXPECT_NEAR(length(v), 1, 1e-6);
    }
}

TEST(GuideTree, LearnsALampWithParallax) {
    const GuideTree tree(samples_under_lamp(20000), 1);
    EXPECT_GT(tree.cells().size(), 4u);
    for (const Vec2 at : {Vec2{0.1f, 0.9f}, Vec2{0.5f, 0.5f}, Vec2{0.93f, 0.12f}}) {
        const Vec3 p{at.x, at.y, 0};
        const GuideCell& cell = tree.cell(p);
        const Vec3 to_lamp = normalize(Vec3{0.2f, 0.3f, 1} - p);
        EXPECT_GT(cell.field(kEye).mixture.pdf({cell.center - p, {0, 0, 1}}, to_lamp), 100);
        EXPECT_GT(cell.field(kEye).share[0], 0.8f);
        EXPECT_EQ(cell.field(kLight).share[0], 0) << "nothing can be gained";
    }
    EXPECT_GT(tree.gain(kEye), 3);
    EXPECT_EQ(tree.gain(kLight), 0);
}

/// Under uniform light a cosine density is the best. Lobes have to follow the radiance, which is constant; shares are those
/// of the power, which has the cosine.
TEST(GuideTree, LearnsNothingFromUniformLight) {
    std::vector<GuideSample> samples;
    add_square(samples, 20000, 0, 1, kEye, false, 1, 5);
    const GuideTree tree(samples, 1, {.least_gain = 0.05f});
    for (const GuideCell& cell : tree.cells()) EXPECT_EQ(cell.field(kEye).share[0], 0);
    EXPECT_EQ(tree.gain(kEye), 0);
}

/// Two rooms with a wall between x = 0 and 0.2. All light comes from a lamp in the right one; hardly any light walk, but many
/// eye walks, come to the left one, whose few photons have no structure.
TEST(GuideTree, LearnsNothingThroughAWall) {
    std::vector<GuideSample> samples;
    add_square(samples, 4000, 0.2f, 1, kEye, true, 1, 5);
    add_square(samples, 100, -1, 1, kEye, false, 1, 6);
    add_square(samples, 3900, -1, 1, kLight, false, 1, 7);
    const GuideTree tree(samples, 1);
    const GuideCell &left = tree.cell({-0.5f, 0.5f, 0}), &right = tree.cell({0.7f, 0.5f, 0});
    ASSERT_LT(left.center.x, 0);
    ASSERT_GT(right.center.x, 0.2f);
    EXPECT_FALSE(left.field(kEye).mixture.is_empty());
    EXPECT_EQ(left.field(kEye).share[0], 0);
    EXPECT_EQ(left.field(kEye).training_share[0], 0);
    EXPECT_GT(right.field(kEye).share[0], 0.8f);
}

/// A cell without enough of its own samples does not take lobes from the other side of a wall.
TEST(GuideTree, BorrowsNoLobesFromTheOtherSide) {
    std::vector<GuideSample> samples;
    add_square(samples, 4000, 0, 1, kEye, true, 1, 5);
    for (GuideSample& s : samples) s.set_normal({0, 0, -1});
    add_square(samples, 100, -1, 1, kEye, false, 1, 6);
    add_square(samples, 3900, -1, 1, kLight, false, 1, 7);
    const GuideTree tree(samples, 1);
    const GuideCell& cell = tree.cell({-0.5f, 0.5f, 0});
    const Vec3 to_lamp = normalize(Vec3{0.5f, 0.5f, 1} - cell.center);
    EXPECT_LT(cell.field(kEye).mixture.pdf({{}, {0, 0, 1}}, to_lamp), 2);
}

/// Most light times importance is on the small square, although it has no more samples than the other.
TEST(GuideTree, GainIsThatOfWhatWalksContribute) {
    const auto both = [](bool is_at_small, float outlier) {
        std::vector<GuideSample> samples;
        add_square(samples, 8000, 0, 0.1f, kEye, is_at_small, 1, 5);
        add_square(samples, 8000, 0, 0.1f, kLight, false, 1, 6);
        add_square(samples, 8000, 10, 3, kEye, !is_at_small, 1, 7);
        add_square(samples, 8000, 10, 3, kLight, false, 1, 8);
        add_square(samples, 1, 10, 3, kEye, false, outlier, 9);
        return samples;
    };
    const double gain = double(GuideTree(both(true, 1), 1).gain(kEye));
    EXPECT_GT(gain, 2.5);
    EXPECT_LT(GuideTree(both(false, 1), 1).gain(kEye), 0.02 * gain);
    EXPECT_NEAR(GuideTree(both(true, 1e5f), 1).gain(kEye), gain, 0.05 * gain)
        << "one sample decides";
}

/// Two samples of a cell of their own, which lie close together, tell nothing about the power per area there.
TEST(GuideTree, GainIsNotThatOfAFewSamples) {
    std::vector<GuideSample> samples;
    add_square(samples, 4000, 0, 1, kEye, true, 1, 5);
    add_square(samples, 4000, 0, 1, kLight, false, 1, 6);
    const float gain = GuideTree(samples, 1).gain(kEye);
    add_square(samples, 1, 1e4f, 0, kEye, false, 1, 7);
    add_square(samples, 1, 1e4f, 0, kLight, false, 1, 8);
    samples.back().p = samples[samples.size() - 2].p + Vec3{0, 1e-4f, 1e-4f};
    const GuideTree tree(samples, 1);
    ASSERT_NEAR(tree.cell({1e4f, 0, 0}).center.x, 1e4f, 1) << "not a cell of its own";
    EXPECT_NEAR(tree.gain(kEye), gain, 0.1f * gain);
}

/// Half of the light is at matte places, where nothing is gained, and half at glossy ones below a lamp. Whether the matte ones
/// are of one class or of two does not matter.
TEST(GuideTree, GainIsTheMeanOverClassesOfGloss) {
    constexpr size_t kMatte = 1500;
    const auto learned = [](bool has_two_classes) {
        std::vector<GuideSample> samples;
        add_square(samples, kMatte, 0, 1, kEye, false, 1, 5);
        add_square(samples, kMatte, 0, 1, kEye, true, 1, 6);
        for (size_t i = 0; i < samples.size(); ++i)
            samples[i].gloss_class = i >= kMatte ? 2 : has_two_classes && i / 4 % 2 == 0 ? 1 : 0;
        std::vector<GuideSample> shuffled;
        for (size_t i = 0; i < samples.size(); ++i)
            shuffled.push_back(samples[i * (kMatte + 1) % samples.size()]);
        return GuideTree(shuffled, 1, {.least_gain = 0.05f});
    };
    const GuideTree one = learned(false), two = learned(true);
    ASSERT_EQ(two.cell({}).field(kEye).share[0], 0);
    ASSERT_EQ(two.cell({}).field(kEye).share[1], 0);
    ASSERT_GT(two.cell({}).field(kEye).share[2], 0.8f);
    EXPECT_NEAR(one.gain(kEye), two.gain(kEye), 0.01f * two.gain(kEye));
}

/// Importance that the lens gives directly makes places count, though light walks learn no direction from it.
TEST(GuideTree, GainKnowsWhatTheLensSees) {
    std::vector<GuideSample> samples;
    add_square(samples, 8000, 0, 1, kEye, true, 1, 5);
    add_square(samples, 8000, 0, 1, kLight, false, 1, 6);
    add_square(samples, 8000, 10, 1, kEye, false, 1, 7);
    add_square(samples, 8000, 10, 1, kLight, false, 1, 8);
    const auto seen = [](float x) {
        GuideTree::LeftOut left_out;
        Random random(3);
        for (int i = 0; i < 8000; ++i) {
            const Vec2 at = random.next_2d();
            left_out[size_t(kLight)].push_back({{x + at.x, at.y, 0}, {0, 0, 1}, 20});
        }
        return left_out;
    };
    const float plain = GuideTree(samples, 1).gain(kEye);
    EXPECT_GT(GuideTree(samples, 1, {}, seen(0)).gain(kEye), 1.6f * plain);
    EXPECT_LT(GuideTree(samples, 1, {}, seen(10)).gain(kEye), 0.4f * plain);
}

/// Walks that train are guided where those of a method gain too little.
TEST(GuideTree, TeachesWhereAMethodGainsTooLittle) {
    const GuideLearning learning{.least_gain = 100, .most_share = 0.3f};
    GuideTree tree(samples_under_lamp(20000), 1, learning);
    for (const GuideCell& cell : tree.cells()) EXPECT_EQ(cell.field(kEye).share[0], 0);
    EXPECT_EQ(tree.gain(kEye), 0);
    tree.use_training_shares();
    for (const GuideCell& cell : tree.cells()) {
        EXPECT_GT(cell.field(kEye).share[0], 0.8f);
        EXPECT_EQ(cell.field(kLight).share[0], 0) << "nothing can be gained";
    }
}

TEST(GuideTree, SamplesThatAreNotFiniteDoNotCount) {
    const std::vector<GuideSample> samples = samples_under_lamp(20000);
    std::vector<GuideSample> more = samples;
    GuideSample bad = samples[0];
    for (const float weight : {kInf, std::nanf(""), 0.0f}) {
        bad.weight = weight;
        more.push_back(bad);
    }
    const GuideTree tree(samples, 1), same(more, 1);
    ASSERT_EQ(tree.cells().size(), same.cells().size());
    EXPECT_EQ(tree.gain(kEye), same.gain(kEye));
    EXPECT_EQ(tree.cell({}).field(kEye).share, same.cell({}).field(kEye).share);
}

/// Vertices on the floor of the same places, whose walks contribute more the larger x is, and least on its lower side.
std::vector<ContributionRecord> contributions(int count) {
    Random random(9);
    std::vector<ContributionRecord> records;
    for (int i = 0; i < count; ++i) {
        const Vec2 at = random.next_2d();
        const bool is_above = i % 2 == 0, is_eye = i % 4 < 2;
        ContributionRecord r;
        r.p = {at.x, at.y, 0};
        r.beta = random.next_1d() + 0.1f;
        r.beyond = r.beta * at.x * (is_above ? 1.0f : 0.1f) * (is_eye ? 1.0f : 5.0f);
        r.here = 2 * r.beyond;
        r.mode = uint8_t(is_eye ? kEye : kLight);
        r.face = uint8_t(cube_face({0, 0, is_above ? 1.0f : -1.0f}));
        records.push_back(r);
    }
    return records;
}

TEST(GuideTree, LearnsContributionsByPlaceSideAndMode) {
    GuideTree tree(samples_under_lamp(20000), 1);
    const size_t kAbove = cube_face({0, 0, 1}), kBelow = cube_face({0, 0, -1}),
                 kNowhere = cube_face({1, 0, 0});
    EXPECT_LT(tree.cell({}).field(kEye).contribution[kAbove].beyond, 0) << "not known yet";
    std::vector<ContributionRecord> records = contributions(40000);
    records.push_back(records[0]);
    records.back().here = kInf;  // does not count
    tree.set_contributions(records);
    for (const float x : {0.1f, 0.5f, 0.9f}) {
        // The mean is that over the cell, not at its centre.
        constexpr double kWithinCell = 0.2;
        const GuideCell& cell = tree.cell({x, 0.4f, 0});
        const auto& eye = cell.field(kEye).contribution;
        const auto& light = cell.field(kLight).contribution;
        EXPECT_NEAR(eye[kAbove].beyond, x, kWithinCell);
        EXPECT_NEAR(eye[kAbove].here, 2 * eye[kAbove].beyond, 0.1);
        EXPECT_NEAR(eye[kBelow].beyond / eye[kAbove].beyond, 0.1, 0.1);
        EXPECT_NEAR(light[kAbove].beyond / eye[kAbove].beyond, 5, 1);
        EXPECT_LT(eye[kNowhere].beyond, 0);
        EXPECT_LT(eye[kNowhere].here, 0);
    }
    tree.set_contributions(contributions(100));
    EXPECT_LT(tree.cell({}).field(kEye).contribution[kAbove].beyond, 0) << "too few records";
}

/// Densities of many directions at many places.
std::vector<float> densities(const GuideTree& tree) {
    Random random(21);
    std::vector<float> all;
    for (int i = 0; i < 2000; ++i) {
        const Vec2 at = random.next_2d();
        const Vec3 p{at.x, at.y, 0};
        const GuideCell& cell = tree.cell(p);
        const Vec3 w = random.unit_vector();
        for (const GuideCell::Field& f : cell.fields) {
            all.push_back(f.mixture.pdf({cell.center - p, {0, 0, 1}}, w));
            all.push_back(f.share[0]);
        }
    }
    return all;
}

TEST(GuideTree, IsSavedAndLoaded) {
    const GuideTree tree(samples_under_lamp(20000), 1);
    test::State state;
    tree.save(state);
    GuideTree loaded;
    loaded.load(state);
    EXPECT_EQ(densities(tree), densities(loaded));
    EXPECT_EQ(tree.gain(kEye), loaded.gain(kEye));
}

TEST(GuideTree, IsSavedWithoutPadding) {
    const auto bytes_with = [](int padding) {
        GuideCell cell{};
        std::memset(reinterpret_cast<std::byte*>(&cell) + sizeof cell.center, padding,
                    offsetof(GuideCell, fields) - sizeof cell.center);
        test::State state;
        GuideTree(cell).save(state);
        return state.bytes;
    };
    EXPECT_EQ(bytes_with(0x55), bytes_with(0xaa));
}

TEST(GuideTree, IsTheSameForAnyNumberOfThreads) {
    const std::vector<GuideSample> samples = samples_under_lamp(30000);
    const auto with = [&](size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return densities(GuideTree(samples, 5));
    };
    const auto one = with(1);
    EXPECT_EQ(one, with(2));
    EXPECT_EQ(one, with(7));
}

/// Footprints of photons: eye walks alone, with one share.
TEST(GuideTree, FootprintsGuideEyeWalksAlone) {
    const std::vector<GuideSample> samples = samples_under_lamp(20000);
    const GuideTree tree(samples, 1, {.has_footprints = true});
    EXPECT_GT(tree.cells().size(), 4u);
    for (const GuideCell& cell : tree.cells()) {
        const GuideMixture& eye = cell.field(kEye).mixture;
        EXPECT_TRUE(cell.field(kLight).mixture.is_empty());
        for (size_t c = 0; c < size_t(kGuideClasses); ++c) {
            EXPECT_EQ(cell.field(kEye).share[c], 0.5f);
            EXPECT_EQ(cell.field(kLight).share[c], 0);
        }
        ASSERT_EQ(eye.size(), GuideMixture::kMostLobes);
        for (int k = 0; k < eye.size(); ++k) {
            EXPECT_EQ(eye.lobe(k).kappa, eye.lobe(0).kappa);
            EXPECT_EQ(eye.lobe(k).inv_r, 0);
        }
        const Vec3 to_lamp = normalize(Vec3{0.2f, 0.3f, 1} - cell.center);
        EXPECT_GT(eye.pdf({{}, {0, 0, 1}}, to_lamp), 1);
    }
}

/// Photons become footprints in proportion to their weights, and fewer of them make larger ones.
TEST(FootprintGuide, IsWeightedAndAdapts) {
    GuideSample up, aside;
    up.direction = PackedDirection({0, 0, 1});
    aside.direction = PackedDirection({1, 0, 0});
    up.weight = 3, aside.weight = 1;
    std::vector<const GuideSample*> samples;
    for (int i = 0; i < 50; ++i) samples.insert(samples.end(), {&up, &aside});
    const GuideMixture many = footprint_guide(samples, 7).mixture;
    int upward = 0;
    for (int k = 0; k < many.size(); ++k) upward += many.lobe(k).mean.z > 0.9f;
    EXPECT_NEAR(upward, 12, 1);
    const GuideMixture two = footprint_guide(std::span(samples).first(2), 7).mixture;
    ASSERT_EQ(two.size(), 2);
    EXPECT_LT(two.lobe(0).kappa, many.lobe(0).kappa);
    EXPECT_TRUE(footprint_guide({}, 7).mixture.is_empty());
}

TEST(GuideTree, CoincidentSamplesAreOneCell) {
    std::vector<GuideSample> samples = samples_under_lamp(10000);
    for (GuideSample& s : samples) s.p = {1, 2, 3};
    EXPECT_EQ(GuideTree(samples, 1).cells().size(), 1u);
}

TEST(GuideTree, FewSamplesMakeNoGuide) {
    const GuideTree tree(samples_under_lamp(20), 1);
    EXPECT_EQ(tree.cell({}).field(kEye).share[0], 0);
    EXPECT_TRUE(GuideTree({}, 1).is_empty());
}

TEST(GuideTree, KeepsItsMemoryBound) {
    const GuideTree tree(samples_under_lamp(1 << 21), 1);
    EXPECT_LT(tree.memory_bytes() + (size_t(1) << 21) * sizeof(GuideSample), size_t(128) << 20);
}

}  // namespace
}  // namespace etendue
