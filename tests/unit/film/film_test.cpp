#include "film/film.h"

#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "film/thread_arena.h"
#include "math/statistics.h"
#include "system/section_file.h"
#include "thread_ranks.h"

namespace etendue {
namespace {

constexpr FilmGeometry kGeometry{20, 10, 0, 0, 20, 10};

/// Passes of random values: eye contributions, and splats of `light_paths` paths where there are any.
class Passes {
public:
    explicit Passes(Film& film) : film_(film) {}

    /// One pass, not ended.
    void begin(uint64_t light_paths = 0) {
        film_.begin_pass(light_paths);
        std::exponential_distribution<float> value(1);
        std::uniform_real_distribution<float> point(-2, 22);
        for (uint64_t i = 0; i < film_.geometry().pixel_count(); ++i)
            film_.add_eye(i, {value(random_), value(random_) * float(i), 0});
        for (uint64_t i = 0; i < light_paths; ++i)
            film_.add_splat({point(random_), point(random_)}, Rgb(value(random_)));
    }
    void add(uint64_t light_paths = 0) {
        begin(light_paths);
        film_.end_pass();
        film_.renew_expected();
    }

private:
    Film& film_;
    std::mt19937 random_{1};
};

/// Everything that can be read of the totals.
struct Totals {
    std::vector<Rgb> image, variance;
    std::vector<float> expected, expected_blocks;
    ErrorEstimate error;
    Film::MeanEstimate mean;
    uint64_t passes, rejected;

    explicit Totals(const Film& f, bool has_splats)
        : image(f.image()), variance(f.variance()), error(f.error()), mean(f.mean_luminance()),
          passes(f.passes()), rejected(f.rejected()) {
        for (uint64_t i = 0; i < f.geometry().pixel_count(); ++i) {
            expected.push_back(f.expected().at(i));
            if (has_splats)
                expected_blocks.push_back(f.expected().at(f.geometry().pixel_center(i)));
        }
    }
    void expect_same_bits(const Totals& o) const {
        for (size_t i = 0; i < image.size(); ++i)
            for (int c = 0; c < 3; ++c) {
                ASSERT_EQ(image[i][c], o.image[i][c]) << i;
                ASSERT_EQ(variance[i][c], o.variance[i][c]) << i;
            }
        EXPECT_EQ(expected, o.expected);
        EXPECT_EQ(expected_blocks, o.expected_blocks);
        EXPECT_EQ(error.relative_rms, o.error.relative_rms);
        EXPECT_EQ(error.low, o.error.low);
        EXPECT_EQ(error.high, o.error.high);
        EXPECT_EQ(mean.mean, o.mean.mean);
        EXPECT_EQ(mean.standard_error, o.mean.standard_error);
        EXPECT_EQ(passes, o.passes);
        EXPECT_EQ(rejected, o.rejected);
    }
};

TEST(FilmGeometry, FindsThePixelNearestToAnyPoint) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const FilmGeometry g{40, 30, 7, 5, 10, 8};
    EXPECT_EQ(g.pixel_at({7.0f, 5.0f}), 0u);
    EXPECT_EQ(g.pixel_at({7.99f, 5.99f}), 0u);
    EXPECT_EQ(g.pixel_at({8.0f, 6.0f}), 11u);
    EXPECT_EQ(g.pixel_at({16.99f, 12.99f}), 79u);
    for (const float far : {-0.5f, 4.9f, -3e9f, -1e30f, -kInfinity, std::nanf("")})
        EXPECT_EQ(g.pixel_at({far, far}), 0u) << far;
    for (const float far : {17.0f, 1e4f, 3e9f, 1e30f, kInfinity})
        EXPECT_EQ(g.pixel_at({far, far}), 79u) << far;
    for (uint64_t i = 0; i < g.pixel_count(); ++i) EXPECT_EQ(g.pixel_at(g.pixel_center(i)), i);
}

TEST(FilmGeometry, VisitsThePixelsThatAFilterReaches) {
    const FilmGeometry g{40, 30, 7, 5, 10, 8};
    const auto visited = [&](Vec2 point, const ReconstructionFilter& filter) {
        std::vector<uint64_t> all;
        for_each_pixel(g, filter, point, [&](uint64_t i, float h) {
            EXPECT_NE(h, 0);
            all.push_back(i);
        });
        return all;
    };
    const auto box = ReconstructionFilter::box();
    const ReconstructionFilter wide("wide", 1.5f, [](double, double, double) { return 1.0; });
    EXPECT_EQ(visited({8.5f, 6.5f}, box), (std::vector<uint64_t>{11}));
    EXPECT_EQ(visited({8.5f, 6.5f}, wide),
              (std::vector<uint64_t>{0, 1, 2, 10, 11, 12, 20, 21, 22}));
    EXPECT_EQ(visited({6.5f, 4.5f}, wide), (std::vector<uint64_t>{0}));
    EXPECT_EQ(visited({16.9f, 12.9f}, box), (std::vector<uint64_t>{79}));
    for (const float far : {-3e9f, -1e30f, -100.0f, -1.5f, 40.0f, 3e9f, 1e30f, std::nanf("")})
        EXPECT_EQ(visited({far, far}, wide), std::vector<uint64_t>()) << far;
}

TEST(Film, ImageAndVarianceAreThoseOfThePasses) {
    Film film(kGeometry, ReconstructionFilter::box());
    EXPECT_EQ(film.variance()[3].r, 0);
    std::vector<Moments> red(kGeometry.pixel_count()), green(kGeometry.pixel_count());
    Moments whole;
    std::mt19937 random(4);
    std::exponential_distribution<float> value(1);
    for (int pass = 0; pass < 9; ++pass) {
        film.begin_pass(0);
        double mean = 0;
        for (uint64_t i = 0; i < kGeometry.pixel_count(); ++i) {
            // In two parts, as an eye path adds what it finds.
            const Rgb a{value(random), 1, 0}, b{0, value(random), 0};
            film.add_eye(i, a);
            film.add_eye(i, b);
            red[i].add(a.r);
            green[i].add(a.g + b.g);
            mean += luminance(a + b) / double(kGeometry.pixel_count());
        }
        film.end_pass();
        whole.add(mean);
    }
    const std::vector<Rgb> image = film.image(), variance = film.variance();
    for (uint64_t i = 0; i < kGeometry.pixel_count(); ++i) {
        EXPECT_NEAR(image[i].r, red[i].mean(), 1e-6);
        EXPECT_NEAR(image[i].g, green[i].mean(), 1e-6);
        EXPECT_NEAR(variance[i].r, red[i].squared_error(), 1e-5);
        EXPECT_NEAR(variance[i].g, green[i].squared_error(), 1e-5);
        EXPECT_EQ(variance[i].b, 0);
    }
    EXPECT_EQ(film.passes(), 9u);
    EXPECT_NEAR(film.mean_luminance().mean, whole.mean(), 1e-6);
    EXPECT_NEAR(film.mean_luminance().standard_error.value(), std::sqrt(whole.squared_error()),
                1e-6);
    EXPECT_EQ(film.mean_luminance().count, 9);
}

/// One pass has no spread, and chains have none until each of them has had a pass.
TEST(Film, ErrorOfTheMeanIsUnknownAtFirst) {
    for (const int groups : {0, 4}) {
        Film film(kGeometry, ReconstructionFilter::box());
        if (groups > 0) film.set_groups(groups);
        const int enough = std::max(groups, 2);
        for (int pass = 0; pass < 2 * enough; ++pass) {
            EXPECT_EQ(film.mean_luminance().standard_error.has_value(), pass >= enough)
                << groups << " groups, " << pass << " passes";
            film.begin_pass(0);
            film.add_eye(0, Rgb(float(pass % 3)));
            film.end_pass();
        }
        EXPECT_EQ(film.mean_luminance().count, groups > 0 ? groups : 2 * enough);
    }
}

/// Pixels of one expectation and known variance, so that the relative error is known.
TEST(Film, ErrorIsThatOfTheMean) {
    Film film({100, 100, 0, 0, 100, 100}, ReconstructionFilter::box());
    std::mt19937 random(5);
    std::uniform_real_distribution<float> value(0, 2);
    constexpr int kPasses = 64;
    for (int pass = 0; pass < kPasses; ++pass) {
        EXPECT_EQ(film.error().valid, pass >= 10) << pass;
        film.begin_pass(0);
        for (uint64_t i = 0; i < 10000; ++i) film.add_eye(i, Rgb(value(random)));
        film.end_pass();
    }
    // Variance 1/3 of a pass; I = 1. Noise of I² adds a little.
    const double expected = std::sqrt(1.0 / 3 / kPasses / 1.01);
    EXPECT_NEAR(film.error().relative_rms, expected, 0.03 * expected);
    EXPECT_LT(film.error().low, film.error().relative_rms);
    EXPECT_GT(film.error().high, film.error().relative_rms);
}

/// An image is noisy after few passes, and more so where a pair of them is bright: an error that is relative to it is too
/// small. The channels are independent, so that the variance of the luminance is not that of any channel.
class ErrorOfRareValues : public ::testing::TestWithParam<int> {};

TEST_P(ErrorOfRareValues, IsThatOfTheMean) {
    constexpr int kSums = 50;
    const int parts = GetParam(), passes = 128 / parts;
    const double variance =
        4 * (sqr(double(luminance({1, 0, 0}))) + sqr(double(luminance({0, 1, 0}))) +
             sqr(double(luminance({0, 0, 1}))));
    const double expected = std::sqrt(variance / (parts * passes) / 1.01);
    constexpr FilmGeometry kSize{10, 10, 0, 0, 10, 10};
    std::mt19937 random(7);
    std::gamma_distribution<float> value(0.25f, 4);  // mean 1, variance 4
    Moments relative;
    int covered = 0;
    for (int s = 0; s < kSums; ++s) {
        std::unique_ptr<Film> sum;
        for (int p = 0; p < parts; ++p) {
            auto part = std::make_unique<Film>(kSize, ReconstructionFilter::box());
            for (int pass = 0; pass < passes; ++pass) {
                part->begin_pass(0);
                for (uint64_t i = 0; i < kSize.pixel_count(); ++i)
                    part->add_eye(i, {value(random), value(random), value(random)});
                part->end_pass();
            }
            if (sum)
                sum->merge(*part);
            else
                sum = std::move(part);
        }
        const ErrorEstimate e = sum->error();
        ASSERT_TRUE(e.valid);
        relative.add(e.relative_rms);
        covered += e.low <= expected && expected <= e.high;
        EXPECT_LT(e.high - e.low, 0.2 * expected);
    }
    // Noise of I² takes 1.6 % away.
    EXPECT_NEAR(relative.mean() / expected, 1, 0.03);
    EXPECT_GE(covered, kSums * 7 / 10) << "of " << kSums;
}

INSTANTIATE_TEST_SUITE_P(Parts, ErrorOfRareValues, ::testing::Values(1, 8));

TEST(Film, ASumOfEqualPassesHasNoError) {
    Film sum(kGeometry, ReconstructionFilter::box()), part(kGeometry, ReconstructionFilter::box());
    for (Film* film : {&sum, &part})
        for (int pass = 0; pass < 12; ++pass) {
            film->begin_pass(0);
            for (uint64_t i = 0; i < kGeometry.pixel_count(); ++i)
                film->add_eye(i, {0.3f, 0.1f * float(i), 0.7f});
            film->end_pass();
        }
    sum.merge(part);
    ASSERT_TRUE(sum.error().valid);
    EXPECT_LT(sum.error().high, 1e-7);
}

/// Passes of a group share what they have: more of them make the image no better.
TEST(Film, ErrorIsThatOfGroups) {
    constexpr int kGroups = 16, kPasses = 40, kFilms = 30;
    Moments relative;
    Moments variance, mean_error2;
    for (int f = 0; f < kFilms; ++f) {
        Film film({100, 20, 0, 0, 100, 20}, ReconstructionFilter::box());
        film.set_groups(kGroups);
        for (int pass = 0; pass < kPasses; ++pass) {
            EXPECT_EQ(film.error().valid, pass >= kGroups) << pass;
            film.begin_pass(0);
            std::mt19937 random(unsigned(1000 * f + pass % kGroups));
            std::uniform_real_distribution<float> value(0, 2);
            for (uint64_t i = 0; i < 2000; ++i) film.add_eye(i, Rgb(value(random)));
            film.end_pass();
        }
        relative.add(sqr(film.error().relative_rms));
        EXPECT_LT(film.error().low, film.error().relative_rms);
        EXPECT_GT(film.error().high, film.error().relative_rms);
        for (const Rgb& v : film.variance()) variance.add(double(v.g));
        mean_error2.add(sqr(film.mean_luminance().standard_error.value()));
    }
    // 1/3 of a group. Of 40 passes eight groups have three and eight two; the difference of two of them is not smaller for
    // it.
    const double expected = 1.0 / 3 / kGroups;
    // Noise of I adds 3 Var(I), where the image weighs groups 3 to 2.
    const double noise = 3 * (1.0 / 3) * (8 * 9 + 8 * 4) / sqr(double(kPasses));
    EXPECT_NEAR(relative.mean(), (1 + noise) * expected / 1.01, 0.04 * expected);
    EXPECT_NEAR(variance.mean(), expected, 0.03 * expected);
    EXPECT_NEAR(mean_error2.mean(), expected / 2000, 0.25 * expected / 2000);
}

/// A sum of films has the groups of all: with itself, a film has the same error; with one whose pairs of groups are exchanged,
/// none.
TEST(Film, MergedGroupsAddUp) {
    constexpr int kGroups = 4, kPasses = 8;
    const auto render = [](int exchange) {
        auto film =
            std::make_unique<Film>(FilmGeometry{8, 4, 0, 0, 8, 4}, ReconstructionFilter::box());
        film->set_groups(kGroups);
        for (int pass = 0; pass < kPasses; ++pass) {
            film->begin_pass(0);
            std::mt19937 random(unsigned(pass ^ exchange));
            std::uniform_int_distribution<int> value(1, 9);
            for (uint64_t i = 0; i < 32; ++i) film->add_eye(i, Rgb(float(value(random))));
            film->end_pass();
        }
        return film;
    };
    const auto one = render(0), same = render(0), exchanged = render(1);
    const ErrorEstimate alone = one->error();
    ASSERT_TRUE(alone.valid);
    same->merge(*one);
    EXPECT_EQ(same->passes(), 2u * kPasses);
    EXPECT_EQ(same->image(), one->image());
    EXPECT_NEAR(same->error().relative_rms, alone.relative_rms, 1e-6 * alone.relative_rms);
    EXPECT_EQ(same->groups(), kGroups);
    exchanged->merge(*one);
    EXPECT_NEAR(exchanged->error().relative_rms, 0, 1e-6);
    Film other({8, 4, 0, 0, 8, 4}, ReconstructionFilter::box());
    EXPECT_THROW(other.merge(*one), std::runtime_error);
}

/// Splats count in the errors by a factor of their own, eye paths do not.
TEST(Film, ErrorByGroupsScalesSplats) {
    const auto error = [](double splat_factor) {
        Film film({4, 4, 0, 0, 4, 4}, ReconstructionFilter::box());
        film.set_groups(2);
        for (int pass = 0; pass < 4; ++pass) {
            film.begin_pass(1);
            for (uint64_t i = 0; i < 16; ++i) film.add_eye(i, Rgb(1));
            if (pass % 2 == 1) film.add_splat({1.5f, 1.5f}, Rgb(3));
            film.end_pass(splat_factor);
        }
        return film.variance()[5].g;
    };
    EXPECT_GT(error(1), 0);
    EXPECT_NEAR(error(0.5), 0.25 * error(1), 1e-6);
    EXPECT_EQ(error(0), 0);
}

TEST(Film, BlackPassesHaveNoError) {
    Film film(kGeometry, ReconstructionFilter::box());
    for (int pass = 0; pass < 10; ++pass) {
        film.begin_pass(0);
        film.end_pass();
    }
    EXPECT_TRUE(film.error().valid);
    EXPECT_EQ(film.error().relative_rms, 0);
}

/// A square of luminances would leave the range of a float.
TEST(Film, ErrorDoesNotDependOnTheUnitOfRadiance) {
    const auto errors = [](float unit) {
        Film film(kGeometry, ReconstructionFilter::box(), unit),
            part(kGeometry, ReconstructionFilter::box(), unit);
        std::mt19937 random(6);
        std::exponential_distribution<float> value(1);
        for (Film* f : {&film, &part})
            for (int pass = 0; pass < 12; ++pass) {
                f->begin_pass(0);
                for (uint64_t i = 0; i < kGeometry.pixel_count(); ++i)
                    f->add_eye(i, Rgb(value(random) * unit));
                f->end_pass();
            }
        const double alone = film.error().relative_rms;
        film.merge(part);
        return std::pair(alone, film.error().relative_rms);
    };
    const auto expected = errors(1);
    EXPECT_GT(expected.first, 0);
    EXPECT_GT(expected.second, 0);
    for (const float unit : {0x1p-70f, 0x1p70f}) EXPECT_EQ(errors(unit), expected) << unit;
}

TEST(Film, SplatsAreMeansOverTheLightPaths) {
    Film film(kGeometry, ReconstructionFilter::box());
    film.begin_pass(50);
    for (int i = 0; i < 100; ++i) film.add_splat({3.5f, 2.5f}, {2, 4, 0});
    film.end_pass();
    EXPECT_FLOAT_EQ(film.image()[2 * 20 + 3].r, 4);
    EXPECT_FLOAT_EQ(film.image()[2 * 20 + 3].g, 8);
    EXPECT_EQ(film.image()[0].r, 0);
}

TEST(Film, CountsWhatIsNotFinite) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    Film film(kGeometry, ReconstructionFilter::box());
    film.begin_pass(1);
    film.add_splat({3.5f, 2.5f}, {2, kInfinity, 0});
    film.add_eye(7, {std::nanf(""), 1, 1});
    film.add_eye(8, Rgb(1));
    EXPECT_EQ(film.rejected(), 0u) << "the pass is not finished";
    film.end_pass();
    EXPECT_EQ(film.rejected(), 2u);
    EXPECT_EQ(film.image()[7].g, 0);
    EXPECT_EQ(film.image()[8].g, 1);
    film.begin_pass(1);
    film.end_pass();
    EXPECT_EQ(film.rejected(), 2u);
}

TEST(Film, ADroppedPassLeavesNothing) {
    for (const uint64_t light_paths : {0u, 1000u}) {
        Film film(kGeometry, ReconstructionFilter::box());
        Passes passes(film);
        for (const int more : {1, 1, 8}) {  // one pass, a pair, enough for an error
            for (int i = 0; i < more; ++i) passes.add(light_paths);
            const Totals before(film, light_paths > 0);
            passes.begin(light_paths);
            film.add_eye(3, Rgb(std::nanf("")));
            if (light_paths > 0) {
                film.add_splat({1.5f, 1.5f}, Rgb(1e20f));
                film.add_splat({1.5f, 1.5f}, Rgb(std::nanf("")));
            }
            Totals(film, light_paths > 0).expect_same_bits(before);
            film.drop_pass();
            Totals(film, light_paths > 0).expect_same_bits(before);
        }
    }
}

TEST(Film, PassesAfterADroppedOneAreAsWithoutIt) {
    const auto totals = [](bool drops) {
        Film film(kGeometry, ReconstructionFilter::box());
        Passes passes(film);
        Passes other(film);
        for (int i = 0; i < 11; ++i) {
            if (drops && i % 3 == 0) {
                other.begin(500);
                film.add_splat({1.5f, 1.5f}, Rgb(1e20f));
                film.drop_pass();
            }
            passes.add(500);
        }
        return Totals(film, true);
    };
    totals(true).expect_same_bits(totals(false));
}

/// Also sums over several chunks, of films with and without groups.
TEST(Film, TotalsDoNotDependOnTheThreads) {
    constexpr FilmGeometry kLarge{130, 100, 0, 0, 130, 100};
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 8);
    for (const int groups : {0, 4}) {
        const auto totals = [&](int threads) {
            ThreadArena arena(threads);
            return arena.execute([&] {
                Film film(kLarge, ReconstructionFilter::box());
                if (groups > 0) film.set_groups(groups);
                Passes passes(film);
                for (int i = 0; i < 12; ++i) passes.add(500);
                return Totals(film, true);
            });
        };
        const Totals one = totals(1);
        EXPECT_TRUE(one.error.valid);
        for (const int threads : {2, 7}) one.expect_same_bits(totals(threads));
    }
}

/// Python asks for the error after each pass.
TEST(Film, TimeOfErrorsDoesNotGrowWithThePasses) {
    constexpr FilmGeometry kPixel{1, 1, 0, 0, 1, 1};
    Film film(kPixel, ReconstructionFilter::box());
    std::mt19937 random(1);
    std::exponential_distribution<float> value(1);
    const auto seconds_after = [&](uint64_t passes) {
        while (film.passes() < passes) {
            film.begin_pass(0);
            film.add_eye(0, Rgb(value(random)));
            film.end_pass();
        }
        const std::clock_t begin = std::clock();
        for (int i = 0; i < 10000; ++i) EXPECT_TRUE(film.error().valid);
        return double(std::clock() - begin) / CLOCKS_PER_SEC;
    };
    const double early = seconds_after(1000), late = seconds_after(100000);
    EXPECT_LT(late, 10 * early + 0.01);
    // The same as that of a film which is read, whose sums are made anew.
    SectionWriter to;
    film.save(to);
    Film read(kPixel, ReconstructionFilter::box());
    SectionReader from(to.take(), "film");
    read.load(from);
    EXPECT_EQ(read.error().low, film.error().low);
    EXPECT_EQ(read.error().high, film.error().high);
    EXPECT_EQ(read.error().relative_rms, film.error().relative_rms);
}

/// The largest passes are those of the differences of the totals, for any number of threads.
TEST(Film, NotesTheBrightestPassOfEachPixel) {
    constexpr int kPasses = 10;
    constexpr FilmGeometry kLarge{130, 100, 0, 0, 130, 100};
    std::vector<LargestPass> first;
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 8);
    for (const int threads : {1, 7}) {
        SCOPED_TRACE(threads);
        ThreadArena arena(threads);
        arena.execute([&] {
            Film film(kLarge, ReconstructionFilter::box());
            EXPECT_TRUE(film.largest().empty());
            film.keep_largest();
            Passes passes(film);
            std::vector<LargestPass> expected(kLarge.pixel_count());
            for (uint32_t pass = 0; pass < kPasses; ++pass) {
                const std::vector<PixelMoments> before(film.moments().begin(),
                                                       film.moments().end());
                passes.add(pass % 2 == 0 ? 500 : 0);
                for (size_t i = 0; i < expected.size(); ++i) {
                    const float value =
                        film.moments()[i].luminance_sum() - before[i].luminance_sum();
                    if (value > expected[i].luminance) expected[i] = {value, pass};
                }
            }
            ASSERT_EQ(film.largest().size(), expected.size());
            for (size_t i = 0; i < expected.size(); ++i) {
                const auto [luminance, pass] = film.largest()[i];
                ASSERT_EQ(pass, expected[i].pass) << i;
                ASSERT_NEAR(luminance, expected[i].luminance, 1e-5f * luminance) << i;
            }
            if (first.empty()) first.assign(film.largest().begin(), film.largest().end());
            for (size_t i = 0; i < first.size(); ++i)
                ASSERT_EQ(film.largest()[i].luminance, first[i].luminance) << i;
        });
    }
}

/// Several processes, each of which adds up some of the pixels, if there are enough of them.
TEST(Film, OfSeveralProcessesHasTheSameTotals) {
    constexpr int kPasses = 11;
    for (const FilmGeometry& g : {FilmGeometry{130, 100, 0, 0, 130, 100}, kGeometry}) {
        const auto add = [&](Film& film, int pass) {
            std::mt19937 random{unsigned(pass)};
            std::exponential_distribution<float> value(1);
            film.begin_pass(1);
            for (uint64_t i = 0; i < g.pixel_count(); ++i) film.add_eye(i, Rgb(value(random)));
            film.add_splat({3.5f, 2.5f}, Rgb(value(random)));
            film.add_eye(uint64_t(pass), Rgb(std::nanf("")));
        };
        Film alone(g, ReconstructionFilter::box());
        for (int pass = 0; pass < kPasses; ++pass) {
            add(alone, pass);
            alone.end_pass();
        }
        alone.renew_expected();
        EXPECT_EQ(alone.rejected(), uint64_t(kPasses));
        for (const int count : {2, 3, 5}) {
            SCOPED_TRACE(count);
            test::ThreadRanks::run(count, [&](const Ranks& ranks) {
                Film film(g, ReconstructionFilter::box());
                film.set_ranks(ranks);
                for (int pass = 0; pass < kPasses; pass += count) {
                    const int made = std::min(count, kPasses - pass);
                    if (ranks.index() < made) {
                        add(film, pass + ranks.index());
                        film.finish_pass();
                    }
                    const auto rejected = ranks.gather_values(film.rejected_in_pass());
                    film.exchange(made);
                    for (int r = 0; r < made; ++r) film.add_pass(r, rejected[size_t(r)]);
                }
                film.complete();
                film.renew_expected();
                Totals(film, true).expect_same_bits(Totals(alone, true));
            });
        }
    }
}

}  // namespace
}  // namespace etendue
