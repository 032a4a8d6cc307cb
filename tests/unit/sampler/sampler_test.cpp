#include "sampler/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "chi2.h"

namespace etendue {
namespace {

using testing::chi2_test;

/// All χ² tests of this file together raise a false alarm with this probability (were the seeds not
/// fixed).
constexpr double kFalseAlarm = 1e-3;
constexpr int kTests = 64;

void expect_uniform(const std::vector<int64_t>& counts) {
    int64_t samples = 0;
    for (const int64_t c : counts) samples += c;
    const std::vector<double> probabilities(counts.size(), 1.0 / double(counts.size()));
    const auto result = chi2_test(counts, probabilities, samples);
    EXPECT_GT(result.p_value, sidak(kFalseAlarm, kTests))
        << "chi2 " << result.statistic << " at " << result.degrees << " degrees of freedom";
}

struct Address {
    uint32_t pass = 0;
    uint64_t path = 0;
    Stream stream = Stream::Eye;
    uint32_t vertex = 0;
    uint32_t slot = 0;
    uint64_t seed = 1;
};

/// The pair of numbers at an address.
Vec2 pair_at(SamplerKind kind, const Address& a) {
    Sampler s(kind, a.seed);
    s.start(a.pass, a.path);
    s.seek(a.stream, a.vertex);
    for (uint32_t i = 0; i < a.slot; ++i) s.next_2d();
    return s.next_2d();
}

class EverySampler : public ::testing::TestWithParam<SamplerKind> {};

constexpr Stream kStreams[] = {Stream::Eye, Stream::Light, Stream::Connection, Stream::Auxiliary};
constexpr int kCells = 16;
constexpr int kDraws = 1 << 16;

TEST_P(EverySampler, NumbersAreUniformInEveryStream) {
    for (const Stream stream : kStreams) {
        std::vector<int64_t> one(256), two(kCells * kCells);
        Sampler s(GetParam(), 7);
        for (int path = 0; path < kDraws; ++path) {
            s.start(3, uint64_t(path));
            s.seek(stream, 2);
            const float u = s.next_1d();
            const Vec2 v = s.next_2d();
            ++one[size_t(u * 256)];
            ++two[size_t(v.x * kCells) * kCells + size_t(v.y * kCells)];
        }
        expect_uniform(one);
        expect_uniform(two);
    }
}

// Numbers at neighbouring addresses, for all values of the other coordinates: every pair of them is
// uniform on the square.
TEST_P(EverySampler, NeighboursAreIndependent) {
    using Step = std::pair<const char*, std::function<void(Address&)>>;
    std::vector<Step> steps = {
        {"slot", [](Address& a) { ++a.slot; }},
        {"vertex", [](Address& a) { ++a.vertex; }},
        {"stream", [](Address& a) { a.stream = Stream::Light; }},
        {"path", [](Address& a) { ++a.path; }},
        {"seed", [](Address& a) { ++a.seed; }},
        {"slot for vertex", [](Address& a) { a.vertex += a.slot, a.slot = 0; }},
    };
    // Sobol' points of neighbouring passes avoid each other on purpose.
    if (GetParam() == SamplerKind::Independent)
        steps.push_back({"pass", [](Address& a) { ++a.pass; }});
    for (const auto& [name, step] : steps) {
        SCOPED_TRACE(name);
        std::vector<int64_t> xx(kCells * kCells), xy(kCells * kCells);
        for (int i = 0; i < kDraws; ++i) {
            Address a{.pass = uint32_t(i) & 15, .path = uint64_t(2 * i), .vertex = 3, .slot = 1};
            const Vec2 u = pair_at(GetParam(), a);
            step(a);
            const Vec2 v = pair_at(GetParam(), a);
            ++xx[size_t(u.x * kCells) * kCells + size_t(v.x * kCells)];
            ++xy[size_t(u.x * kCells) * kCells + size_t(v.y * kCells)];
        }
        expect_uniform(xx);
        expect_uniform(xy);
    }
}

TEST_P(EverySampler, NumbersHave24FairBitsAndStayBelowOne) {
    constexpr int kBits = 24;
    std::vector<int64_t> ones(kBits);
    Sampler s(GetParam(), 11);
    for (int path = 0; path < kDraws; ++path) {
        s.start(5, uint64_t(path));
        s.seek(Stream::Eye, 0);
        const float u = s.next_2d().y;
        ASSERT_GE(u, 0);
        ASSERT_LT(u, 1);
        const float scaled = u * 0x1p24f;
        ASSERT_EQ(scaled, std::floor(scaled));
        for (int b = 0; b < kBits; ++b) ones[size_t(b)] += uint32_t(scaled) >> b & 1;
    }
    for (const int64_t n : ones) expect_uniform({n, kDraws - n});
}

TEST_P(EverySampler, TheSameAddressGivesTheSameNumber) {
    const Address addresses[] = {{},
                                 {.pass = 9, .path = 1ull << 40, .vertex = 70, .slot = 5},
                                 {.stream = Stream::Auxiliary, .slot = 1000}};
    for (const Address& a : addresses) {
        const Vec2 expected = pair_at(GetParam(), a);
        Sampler s(GetParam(), a.seed);
        // Whatever was drawn before, in whatever order.
        s.start(a.pass + 1, a.path + 1);
        s.seek(Stream::Light, 4);
        for (int i = 0; i < 7; ++i) s.next_1d();
        s.start(a.pass, a.path);
        s.seek(a.stream, a.vertex + 1);
        s.next_2d();
        s.seek(a.stream, a.vertex);
        for (uint32_t i = 0; i < a.slot; ++i) s.next_1d();
        EXPECT_EQ(s.next_2d(), expected);
    }
}

TEST_P(EverySampler, EveryCoordinateOfTheAddressCounts) {
    const Vec2 here = pair_at(GetParam(), {});
    EXPECT_NE(pair_at(GetParam(), {.pass = 1}), here);
    EXPECT_NE(pair_at(GetParam(), {.path = 1}), here);
    EXPECT_NE(pair_at(GetParam(), {.path = 1ull << 32}), here);
    EXPECT_NE(pair_at(GetParam(), {.stream = Stream::Light}), here);
    EXPECT_NE(pair_at(GetParam(), {.vertex = 1}), here);
    EXPECT_NE(pair_at(GetParam(), {.slot = 1}), here);
    EXPECT_NE(pair_at(GetParam(), {.seed = 2}), here);
}

/// Joins are numbered by s, t and more, gathers by light vertices of 32 bits: addresses far beyond 2^24.
TEST_P(EverySampler, LargeNumbersOfVerticesDoNotCollide) {
    std::set<double> numbers;
    size_t count = 0;
    for (const Stream stream : {Stream::Eye, Stream::Light, Stream::Roulette, Stream::Selection})
        for (const uint64_t high : {0ull, 1ull, 2ull, 0x80ull, 0x8001ull, 0x1000000001ull})
            for (uint64_t low = 8; low < 40; ++low) {
                Sampler s(GetParam(), 3);
                s.start(0, 5);
                s.seek(stream, high << 24 | low);
                for (int slot = 0; slot < 4; ++slot, ++count) numbers.insert(s.next_1d_fine());
            }
    EXPECT_EQ(numbers.size(), count);
}

TEST(JoinNumber, IsDistinct) {
    std::set<uint64_t> numbers;
    size_t count = 0;
    for (const int s : {0, 1, 2, 255, 256, 65535})
        for (const int t : {1, 2, 65535, 65536, (1 << 21) - 1})
            for (const uint32_t draw : {0u, 1u, 2u, (1u << 21) - 1}) {
                numbers.insert(join_number(s, t, draw));
                ++count;
            }
    EXPECT_EQ(numbers.size(), count);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EverySampler,
                         ::testing::Values(SamplerKind::Independent, SamplerKind::Sobol),
                         [](const auto& kind) {
                             return kind.param == SamplerKind::Sobol ? "Sobol" : "Independent";
                         });

/// Points of the passes [first, first + count) at one address.
std::vector<Vec2> points_of_passes(SamplerKind kind, Address a, uint32_t first, uint32_t count) {
    std::vector<Vec2> points;
    for (uint32_t i = 0; i < count; ++i) {
        a.pass = first + i;
        points.push_back(pair_at(kind, a));
    }
    return points;
}

/// Whether every elementary interval 2^-j × 2^-(m-j) holds one of the 2^m points.
bool is_net(const std::vector<Vec2>& points, int m) {
    for (int j = 0; j <= m; ++j) {
        std::vector<bool> taken(points.size());
        for (const Vec2 p : points) {
            const auto x = uint32_t(std::ldexp(p.x, j)), y = uint32_t(std::ldexp(p.y, m - j));
            const size_t cell = (size_t(x) << (m - j)) + y;
            if (taken[cell]) return false;
            taken[cell] = true;
        }
    }
    return true;
}

TEST(Sobol, PowersOfTwoOfPassesAreNets) {
    const Address addresses[] = {{},
                                 {.path = 12345, .vertex = 3, .slot = 2, .seed = 99},
                                 {.path = 1, .stream = Stream::Connection, .vertex = 2}};
    for (const Address& a : addresses)
        for (int m = 0; m <= 10; ++m) {
            const uint32_t n = 1u << m;
            EXPECT_TRUE(is_net(points_of_passes(SamplerKind::Sobol, a, 0, n), m)) << m;
            EXPECT_TRUE(is_net(points_of_passes(SamplerKind::Sobol, a, 5 * n, n), m)) << m;
        }
    // The check itself can fail.
    EXPECT_FALSE(is_net(points_of_passes(SamplerKind::Independent, {}, 0, 64), 6));
}

TEST(Sobol, SingleNumbersAreStratified) {
    constexpr uint32_t n = 256;
    std::vector<int> count(n);
    Sampler s(SamplerKind::Sobol, 3);
    for (uint32_t pass = 0; pass < n; ++pass) {
        s.start(pass, 17);
        s.seek(Stream::Light, 1);
        ++count[size_t(s.next_1d() * n)];
    }
    for (const int c : count) EXPECT_EQ(c, 1);
}

// Dimensions of different pairs are padded: over the passes of one path they form no pattern.
TEST(Sobol, PairsOfDimensionsAreIndependentOverThePasses) {
    std::vector<int64_t> cells(kCells * kCells);
    for (uint32_t pass = 0; pass < kDraws; ++pass) {
        const float x = pair_at(SamplerKind::Sobol, {.pass = pass, .slot = 0}).x;
        const float y = pair_at(SamplerKind::Sobol, {.pass = pass, .slot = 1}).x;
        ++cells[size_t(x * kCells) * kCells + size_t(y * kCells)];
    }
    expect_uniform(cells);
}

/// Root mean square error, over many paths, of the mean of a smooth function over the first
/// `passes` passes.
double integration_error(SamplerKind kind, uint32_t passes) {
    // ∫ cos x e^y = sin 1 (e - 1)
    const double exact = std::sin(1.0) * (std::exp(1.0) - 1);
    constexpr int kPaths = 100;
    double squares = 0;
    for (uint64_t path = 0; path < kPaths; ++path) {
        double sum = 0;
        for (uint32_t pass = 0; pass < passes; ++pass) {
            const Vec2 u = pair_at(kind, {.pass = pass, .path = path});
            sum += std::cos(u.x) * std::exp(u.y);
        }
        squares += (sum / passes - exact) * (sum / passes - exact);
    }
    return std::sqrt(squares / kPaths);
}

TEST(Sobol, ErrorFallsFasterThanThatOfIndependentNumbers) {
    const double order_independent = std::log2(integration_error(SamplerKind::Independent, 16) /
                                               integration_error(SamplerKind::Independent, 1024)) /
                                     6;
    const double order_sobol = std::log2(integration_error(SamplerKind::Sobol, 16) /
                                         integration_error(SamplerKind::Sobol, 1024)) /
                               6;
    // n^-1/2, and up to n^-3/2 for Owen-scrambled nets [Owen 1997]; 100 paths leave 0.02.
    EXPECT_NEAR(order_independent, 0.5, 0.08);
    EXPECT_GT(order_sobol, 1.2);
}

class RecordingSource final : public PrimarySource {
public:
    uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) override {
        asked.emplace_back(stream, vertex, slot);
        return 1u << 30;
    }
    std::vector<std::tuple<Stream, uint64_t, uint32_t>> asked;
};

TEST(PrimarySample, NumbersComeFromTheSourceByAddress) {
    RecordingSource source;
    Sampler s(source);
    EXPECT_EQ(s.kind(), SamplerKind::PrimarySample);
    s.start(0, 0);
    s.seek(Stream::Light, 2);
    EXPECT_EQ(s.next_1d(), 0.25f);
    EXPECT_EQ(s.next_2d(), (Vec2{0.25f, 0.25f}));
    s.next_1d();
    s.seek(Stream::Eye, 5);
    s.next_1d();
    const std::vector<std::tuple<Stream, uint64_t, uint32_t>> expected = {{Stream::Light, 2, 0},
                                                                          {Stream::Light, 2, 1},
                                                                          {Stream::Light, 2, 2},
                                                                          {Stream::Light, 2, 3},
                                                                          {Stream::Eye, 5, 0}};
    EXPECT_EQ(source.asked, expected);
}

}  // namespace
}  // namespace etendue
