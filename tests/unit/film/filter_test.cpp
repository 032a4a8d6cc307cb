#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "film/film.h"

namespace etendue {
namespace {

constexpr FilmGeometry kCrop{40, 30, 7, 5, 10, 8};

ReconstructionFilter filter(const std::string& name, float radius = 0) {
    SceneDescription description;
    description.objects = {{"rfilter", name, "", {}, {}, {}}};
    if (radius > 0)
        return ReconstructionFilter(
            name.c_str(), radius, [](double x, double r, double) { return 1 - std::fabs(x) / r; },
            double(radius));
    for (const FilterEntry& e : filter_registry())
        if (e.info.name == name) return e.make({description, 0});
    ADD_FAILURE() << name;
    return ReconstructionFilter::box();
}

std::vector<ReconstructionFilter> all_filters() {
    std::vector<ReconstructionFilter> all;
    for (const char* name : {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"})
        all.push_back(filter(name));
    for (const float radius : {0.01f, 0.3f, 0.7f, 1.4f, 5.5f})
        all.push_back(filter("ramp", radius));
    return all;
}

std::vector<Vec2> some_points() {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> u(0, 1);
    std::vector<Vec2> points = {{0, 0}, {0.5f, 0.5f}, {0.999999f, 0.25f}};
    for (int i = 0; i < 20; ++i) points.push_back({u(random), u(random)});
    return points;
}

TEST(Filter, WeightsOfAllPixelsAreOne) {
    for (const ReconstructionFilter& f : all_filters()) {
        if (!f.is_wide() && !f.is_box()) continue;
        for (const Vec2 p : some_points()) {
            const ReconstructionFilter::Taps t = f.taps(p.x + 12);
            double sum = 0;
            for (int i = 0; i < t.count; ++i) sum += double(t.weight[size_t(i)]);
            EXPECT_NEAR(sum, 1, 1e-6) << f.name() << " " << p.x;
        }
    }
}

TEST(Filter, WeightsAreItsValuesAtThePixels) {
    for (const ReconstructionFilter& f : all_filters())
        for (const Vec2 p : some_points()) {
            const ReconstructionFilter::Taps x = f.taps(p.x), y = f.taps(p.y);
            for (int i = -20; i < 20; ++i) {
                const auto weight = [i](const ReconstructionFilter::Taps& t) {
                    return i >= t.first && i < t.first + t.count ? t.weight[size_t(i - t.first)]
                                                                 : 0;
                };
                EXPECT_NEAR(weight(x) * weight(y),
                            f.eval({p.x - float(i) - 0.5f, p.y - float(i) - 0.5f}), 1e-5)
                    << f.name() << " " << i;
            }
        }
}

TEST(Filter, HasTheIntegralOne) {
    constexpr int kSteps = 4096;  // a multiple of those of its table, between which it is linear
    for (const ReconstructionFilter& f : all_filters()) {
        double sum = 0;
        for (int i = 0; i < kSteps; ++i) {
            const ReconstructionFilter::Taps t = f.taps((float(i) + 0.5f) / kSteps);
            for (int k = 0; k < t.count; ++k) sum += double(t.weight[size_t(k)]) / kSteps;
        }
        EXPECT_NEAR(sum, 1, 1e-5) << f.name() << " " << f.radius();
    }
}

TEST(Filter, SamplesHaveItsShape) {
    std::mt19937 random(2);
    std::uniform_real_distribution<float> u(0, 1);
    for (const ReconstructionFilter& f : all_filters()) {
        double sum = 0, moment = 0, expected = 0;
        constexpr int kSamples = 200'000, kSteps = 4096;
        for (int i = 0; i < kSamples; ++i) {
            const auto s = f.sample({u(random), u(random)});
            sum += double(s.weight) / kSamples;
            moment += double(s.weight) * std::cos(double(s.offset.x)) / kSamples;
        }
        for (int i = 0; i < kSteps; ++i) {
            const float at = (float(i) + 0.5f) / kSteps;
            const ReconstructionFilter::Taps t = f.taps(at);
            for (int k = 0; k < t.count; ++k)
                expected +=
                    double(t.weight[size_t(k)]) * std::cos(double(at) - t.first - k - 0.5) / kSteps;
        }
        EXPECT_NEAR(sum, 1, 0.03) << f.name() << " " << f.radius();
        EXPECT_NEAR(moment, expected, 0.03) << f.name() << " " << f.radius();
    }
}

TEST(SampleGrid, NumbersItsPointsWithoutGaps) {
    for (const ReconstructionFilter& f : all_filters())
        for (const Vec2 offset : some_points()) {
            const SampleGrid grid(kCrop, f, offset);
            std::set<size_t> places;
            for (uint64_t i = 0; i < grid.count(); ++i) {
                const auto [column, row] = grid.cell(i);
                ASSERT_EQ(grid.index(column, row), i) << f.name();
                ASSERT_LT(grid.place(i), grid.count());
                places.insert(grid.place(i));
                if (i < kCrop.pixel_count()) {
                    EXPECT_EQ(kCrop.pixel_at(grid.point(i)), i);
                }
            }
            ASSERT_EQ(places.size(), grid.count()) << f.name();
            if (f.is_box()) {
                EXPECT_EQ(grid.count(), kCrop.pixel_count());
            }
        }
}

TEST(FilterModeSpread, AConstantImageHasNoNoise) {
    for (const ReconstructionFilter& f : all_filters()) {
        Film film(kCrop, f, 1, FilterMode::Spread);
        if (!f.is_wide()) {
            EXPECT_FALSE(film.spreads());
            continue;
        }
        for (const Vec2 offset : some_points()) {
            film.begin_pass(0, offset);
            for (uint64_t i = 0; i < film.sample_count(); ++i) film.add_eye(i, Rgb(3));
            film.end_pass();
        }
        for (const Rgb& c : film.image()) EXPECT_NEAR(c.g, 3, 2e-6) << f.name();
        for (const Rgb& v : film.variance()) EXPECT_NEAR(v.g, 0, 1e-10) << f.name();
    }
}

/// Where samples are spread over pixels, the variance of a pixel is smaller than that of a sample.
TEST(FilterModeSpread, TellsTheVarianceOfAPixelFromThatOfASample) {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> value(0, 1);
    for (const FilterMode mode : {FilterMode::Spread, FilterMode::Sample})
        for (const ReconstructionFilter& f : all_filters()) {
            constexpr int kPasses = 600;
            Film film(kCrop, f, 1, mode);
            for (int pass = 0; pass < kPasses; ++pass) {
                film.begin_pass(0, {value(random), value(random)});
                for (uint64_t i = 0; i < film.sample_count(); ++i)
                    film.add_eye(i, Rgb(value(random)));
                film.end_pass();
            }
            double mean = 0;
            for (const Rgb& v : film.variance()) mean += double(v.g) / double(kCrop.pixel_count());
            EXPECT_NEAR(12 * mean * kPasses / film.variance_of_pixels(), 1, 0.05)
                << f.name() << " " << f.radius() << " " << film.spreads();
        }
}

/// The convolution equals the sum over all samples, each added to the pixels that the filter reaches from its point.
TEST(FilterModeSpread, AddsEverySampleToAllPixelsAround) {
    std::mt19937 random(3);
    std::exponential_distribution<float> value(1);
    for (const ReconstructionFilter& f : all_filters())
        for (const Vec2 offset : some_points()) {
            Film film(kCrop, f, 1, FilterMode::Spread);
            if (!film.spreads()) continue;
            film.begin_pass(0, offset);
            std::vector<double> expected(kCrop.pixel_count()), by_pixel(kCrop.pixel_count());
            std::vector<float> values;
            for (uint64_t i = 0; i < film.sample_count(); ++i) {
                values.push_back(value(random));
                film.add_eye(i, Rgb(values.back()));
                const Film::PixelSample s = film.sample_pixel(i, {});
                EXPECT_EQ(s.weight, 1);
                for_each_pixel(kCrop, f, s.point, [&](uint64_t pixel, float h) {
                    expected[pixel] += double(h) * double(values.back());
                });
            }
            film.end_pass();
            const std::vector<Rgb> image = film.image();
            for (uint64_t i = 0; i < image.size(); ++i) {
                film.for_each_sample_of(i, [&](uint64_t sample, float h) {
                    by_pixel[i] += double(h) * double(values.at(sample));
                });
                ASSERT_NEAR(image[i].r, expected[i], 2e-4) << f.name() << " " << i;
                ASSERT_NEAR(by_pixel[i], image[i].r, 1e-5) << f.name() << " " << i;
            }
        }
}

/// A splat goes to one pixel, on average by the weights of the filter; or to all pixels that it reaches.
TEST(FilterModeSample, AddsASplatToOnePixel) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(0, 1);
    for (const ReconstructionFilter& f : all_filters()) {
        if (!f.is_wide()) continue;
        constexpr int kPasses = 4000;
        constexpr FilmGeometry kSmall{12, 12, 0, 0, 12, 12};
        Film film(kSmall, f, 1, FilterMode::Sample), spread(kSmall, f, 1, FilterMode::Spread);
        ptrdiff_t touched = 0;
        for (int pass = 0; pass < kPasses; ++pass) {
            const Vec2 point{6 + u(random), 6 + u(random)};
            for (Film* to : {&film, &spread}) {
                to->begin_pass(1);
                to->add_splat(point, Rgb(1));
                to->end_pass();
            }
            if (pass == 0)
                touched = std::ranges::count_if(film.image(), [](Rgb c) { return !c.is_zero(); });
        }
        EXPECT_EQ(touched, 1) << f.name();
        const auto mean = film.image(), wanted = spread.image();
        for (size_t i = 0; i < mean.size(); ++i)  // 6 σ, for weights of one sign
            EXPECT_NEAR(mean[i].g, wanted[i].g,
                        6 * std::sqrt((std::abs(wanted[i].g) + 0.002f) / kPasses))
                << f.name() << " " << f.radius() << " " << i;
    }
}

TEST(FilterModeSample, DrawsPixelsAnewInEachPassForTheSamePoint) {
    const auto f = filter("gaussian");
    constexpr int kPasses = 4000;
    constexpr FilmGeometry kSmall{12, 12, 0, 0, 12, 12};
    Film film(kSmall, f, 1, FilterMode::Sample), spread(kSmall, f, 1, FilterMode::Spread);
    for (int pass = 0; pass < kPasses; ++pass)
        for (Film* to : {&film, &spread}) {
            to->begin_pass(1, {0.5f, 0.5f}, uint64_t(pass));
            to->add_splat({6.3f, 5.9f}, Rgb(1));
            to->end_pass();
        }
    const auto mean = film.image(), wanted = spread.image();
    for (size_t i = 0; i < mean.size(); ++i)  // 6 σ
        EXPECT_NEAR(mean[i].g, wanted[i].g, 6 * std::sqrt(wanted[i].g / kPasses)) << i;
}

TEST(FilterModeSpread, CountsWhatIsNotFiniteOnce) {
    Film film(kCrop, filter("gaussian"), 1, FilterMode::Spread);
    film.begin_pass(0, {0.3f, 0.4f});
    for (uint64_t i = 0; i < film.sample_count(); ++i) film.add_eye(i, Rgb(1));
    film.add_eye(33, Rgb(std::nanf("")));
    film.end_pass();
    EXPECT_EQ(film.rejected(), 1u);
    for (const Rgb& c : film.image()) EXPECT_TRUE(is_finite(c));
    EXPECT_LT(film.image()[33].r, 0.9f);
    EXPECT_FLOAT_EQ(film.image()[0].r, 1);
}

}  // namespace
}  // namespace etendue
