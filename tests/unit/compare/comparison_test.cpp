#include "compare/comparison.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include <gtest/gtest.h>

#include "image/image_io.h"
#include "random.h"
#include "render/method_choice.h"
#include "run_program.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using etendue::testing::Random;

const std::atomic<bool> kNotInterrupted{false};

double normal(Random& random) {
    const double u = 1 - random.next_1d(), v = random.next_1d();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * M_PI * v);
}

std::vector<Rgb> noisy(const std::vector<Rgb>& truth, double sigma, Random& random) {
    std::vector<Rgb> out = truth;
    for (Rgb& c : out) c += Rgb(float(sigma * normal(random)));
    return out;
}

Scene small_scene() {
    return build(mixed_room(front_camera(16)));
}

CompareSettings settings_of(const std::vector<std::string>& methods, uint64_t spp) {
    CompareSettings s;
    for (const std::string& m : methods) s.methods.push_back({m, IntegratorSpec::parse(m)});
    s.limits.spp = spp;
    return s;
}

Reference white_reference(const Scene& scene) {
    Reference r;
    r.width = scene.film().crop_width;
    r.height = scene.film().crop_height;
    r.pixels.assign(scene.film().pixel_count(), Rgb(1));
    return r;
}

bool same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0;
}

// ------------------------------------------------------------------------------------------------------- references

TEST(ReferenceVariance, IsSubtractedFromSquaredErrors) {
    constexpr double kOfImage = 0.05, kOfHalf = 0.2;
    Random random(3);
    std::vector<Rgb> truth(100000);
    for (Rgb& c : truth) c = Rgb(random.between(1, 2));
    Reference r;
    r.first = noisy(truth, kOfHalf, random);
    r.second = noisy(truth, kOfHalf, random);
    for (size_t i = 0; i < truth.size(); ++i) r.pixels.push_back((r.first[i] + r.second[i]) * 0.5f);
    const std::vector<Rgb> x = noisy(truth, kOfImage, random);

    // The mean of the halves has variance σ²/2, eight times that of the image; the standard error of the difference
    // is about (σ² / 2) √(2 / pixels), of which four are allowed.
    const double of_mean = kOfHalf * kOfHalf / 2, allowed = 4 * of_mean * std::sqrt(2.0 / 1e5);
    EXPECT_NEAR(image_errors(x, r.half(0), {.reference2 = r.half(1)}).mse, kOfImage * kOfImage,
                allowed);
    EXPECT_NEAR(image_errors(x, r.pixels).mse, kOfImage * kOfImage + of_mean, allowed);
    EXPECT_NEAR(-image_errors(r.pixels, r.half(0), {.reference2 = r.half(1)}).mse, of_mean,
                allowed);
}

TEST(ReferenceVariance, ComesFromTheLayerOfAFile) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "reference.exr").string();
    const std::vector<Rgb> pixels(16 * 16, Rgb(2)), variance(16 * 16, Rgb(0.25f));
    Image image = rgb_image(16, 16, pixels);
    const FilmGeometry film{16, 16, 0, 0, 16, 16};
    write_image(file, image);
    EXPECT_FALSE(read_reference(file, film).has_variance());
    add_rgb_layer(image, 16, 16, "variance", variance);
    write_image(file, image);
    const Reference r = read_reference(file, film);
    ASSERT_TRUE(r.has_variance());
    const std::vector<Rgb> x(16 * 16, Rgb(3));
    EXPECT_NEAR(image_errors(x, r.half(0), {.reference2 = r.half(1)}).mse, 1 - 0.25, 1e-6);
    EXPECT_THROW(read_reference(file, FilmGeometry{16, 8, 0, 0, 16, 8}), std::runtime_error);
}

TEST(MadeReference, IsCachedUntilALongerOneIsRequested) {
    const TemporaryFolder folder;
    const Scene scene = small_scene();
    RenderSettings how;
    how.integrator = IntegratorSpec::parse("path");
    how.spp = 4;
    const auto make = [&](uint64_t scene_hash, uint64_t program = 7) {
        return *make_reference(
            scene, {how, folder.path().string(), scene_hash, program}, [](const Progress&) {},
            kNotInterrupted);
    };
    const Reference first = make(1);
    EXPECT_FALSE(first.reused);
    EXPECT_EQ(first.spp, 4u);
    EXPECT_FALSE(same_bits(first.first, first.second));
    EXPECT_GT(first.mean_error.value, 0);
    EXPECT_LE(first.mean_error.dof, 2);
    const Reference again = make(1);
    EXPECT_TRUE(again.reused);
    EXPECT_TRUE(same_bits(first.pixels, again.pixels));
    EXPECT_TRUE(same_bits(first.second, again.second));
    EXPECT_NEAR(again.mean_error.value, first.mean_error.value, 1e-12 * first.mean_error.value);
    EXPECT_EQ(again.mean_error.dof, first.mean_error.dof);
    EXPECT_FALSE(make(2).reused) << "another scene";
    EXPECT_FALSE(make(1, 8).reused) << "another build of the program";
    how.spp = 8;
    EXPECT_FALSE(make(1).reused) << "more samples";
    how.spp = 4;
    EXPECT_TRUE(make(1).reused) << "fewer";
    how.integrator = IntegratorSpec::parse("path:max_depth=2");
    EXPECT_FALSE(make(1).reused) << "other paths";
}

TEST(MadeReference, IsNotStoredWhenInterrupted) {
    const TemporaryFolder folder;
    const Scene scene = small_scene();
    RenderSettings how;
    how.spp = 4;
    const std::atomic<bool> interrupted{true};
    EXPECT_FALSE(make_reference(
        scene, {how, folder.path().string(), 1, 7}, [](const Progress&) {}, interrupted));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Fingerprint, DependsOnParametersAndContentsOfFiles) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "scene.xml").string(),
                      mesh = (folder.path() / "mesh.obj").string();
    const auto write = [](const std::string& name, const std::string& text) {
        std::ofstream(name) << text;
    };
    const auto fingerprint = [&](const std::string& value) {
        ReadOptions options;
        options.defines["r"] = value;
        return scene_fingerprint(read_mitsuba_xml(file, options));
    };
    write(file, "<scene version=\"3.0.0\"><default name=\"r\" value=\"1\"/><shape type=\"obj\">"
                "<string name=\"filename\" value=\"mesh.obj\"/><float name=\"x\" value=\"$r\"/>"
                "</shape></scene>");
    write(mesh, "v 0 0 0\n");
    const uint64_t first = fingerprint("1");
    EXPECT_EQ(fingerprint("1"), first);
    EXPECT_NE(fingerprint("2"), first);
    write(mesh, "v 0 0 1\n");
    EXPECT_NE(fingerprint("1"), first);
    write(mesh, "v 0 0 0\n");
    EXPECT_EQ(fingerprint("1"), first);
}

// ------------------------------------------------------------------------------------------------------- turns

TEST(Schedule, OfTimeEndsAtTheLimitAndHasEvenCheckpoints) {
    for (const double total : {0.5, 60.0, 3600.0}) {
        const std::vector<Turn> turns = schedule({.spp = {}, .seconds = total, .error = {}});
        EXPECT_DOUBLE_EQ(*turns.back().limits.seconds, total);
        EXPECT_TRUE(turns.back().is_checkpoint);
        double previous = 0, checkpoint = 0;
        for (const Turn& t : turns) {
            const double now = *t.limits.seconds;
            EXPECT_GT(now, previous);
            EXPECT_LE(now - previous, std::min(2.0, total / 32) * (1 + 1e-9));
            previous = now;
            if (!t.is_checkpoint) continue;
            if (checkpoint > 0) {
                EXPECT_NEAR(now / checkpoint, std::sqrt(2.0), 1e-9);
            }
            checkpoint = now;
        }
    }
}

TEST(Schedule, OfSamplesEndsAtTheLimit) {
    for (const uint64_t total : {1u, 2u, 7u, 1000u}) {
        const std::vector<Turn> turns = schedule({.spp = total, .seconds = {}, .error = {}});
        EXPECT_EQ(*turns.back().limits.spp, total);
        EXPECT_TRUE(turns.back().is_checkpoint);
        uint64_t previous = 0;
        for (const Turn& t : turns) {
            EXPECT_GT(*t.limits.spp, previous);
            previous = *t.limits.spp;
        }
    }
}

TEST(Turns, RenderWhatOneCallRenders) {
    const Scene scene = small_scene();
    const Comparison c = compare(
        scene, white_reference(scene), settings_of({"path", "bdpt"}, 9), [](const std::string&) {},
        kNotInterrupted);
    ASSERT_EQ(c.methods.size(), 2u);
    for (const Method& m : c.methods) {
        RenderSettings whole;
        whole.integrator = m.spec.integrator;
        whole.sampler = SamplerKind::Sobol;
        whole.spp = 9;
        Renderer renderer(scene, whole);
        renderer.run([](const Progress&) {}, kNotInterrupted);
        EXPECT_TRUE(same_bits(m.image, renderer.film().image())) << m.name();
        EXPECT_EQ(m.runs.front().stats.rays(), renderer.stats().rays()) << m.name();
        EXPECT_EQ(m.runs.front().spp, 9u);
    }
}

TEST(Turns, RunsHaveSeedsOfTheirOwn) {
    const Scene scene = small_scene();
    CompareSettings s = settings_of({"path"}, 4);
    s.runs = 3;
    s.seed = 5;
    const Comparison c = compare(
        scene, white_reference(scene), s, [](const std::string&) {}, kNotInterrupted);
    const auto& runs = c.methods.front().runs;
    ASSERT_EQ(runs.size(), 3u);
    for (size_t i = 0; i < 3; ++i) EXPECT_EQ(runs[i].seed, 5 + i);
    EXPECT_NE(runs[0].errors().mse, runs[1].errors().mse);
    EXPECT_NE(runs[1].errors().mse, runs[2].errors().mse);
    const MethodSummary summary = summarize(c).front();
    EXPECT_NEAR(summary.rel_mse,
                (runs[0].errors().rel_mse + runs[1].errors().rel_mse + runs[2].errors().rel_mse) /
                    3,
                1e-12);
    EXPECT_TRUE(summary.rel_mse_interval);
    EXPECT_NEAR(summary.efficiency->value, 1, 1e-12);
    EXPECT_FALSE(summary.reference_share) << "the white image has no known variance";
}

TEST(Turns, RefuseUnknownAndRepeatedMethods) {
    const auto specs = [](const std::vector<std::string>& methods) {
        return settings_of(methods, 1).methods;
    };
    EXPECT_NO_THROW(check_methods(specs({"path", "bdpt", "bdpt:max_depth=3"})));
    EXPECT_THROW(check_methods(specs({"path", "bdtp"})), std::runtime_error);
    EXPECT_THROW(check_methods(specs({"path:depth=3"})), std::runtime_error);
    EXPECT_THROW(check_methods(specs({"path", "bdpt", "path"})), std::runtime_error);
}

/// Of runs that have different lengths, as those of another program may, each has the same error times time.
TEST(Summary, EfficiencyIsOfTheRunsAndNotOfTheirMeans) {
    const auto method = [](const char* name, std::vector<double> seconds) {
        Method m;
        m.spec.name = name;
        for (const double t : seconds) {
            etendue::Run& run = m.runs.emplace_back();
            run.seconds = t;
            run.checkpoints.push_back({1, t, {}});
            run.checkpoints.back().errors.rel_mse = 1 / t;
        }
        return m;
    };
    Comparison c;
    c.methods = {method("equal", {2, 2}), method("different", {1, 4})};
    const std::vector<MethodSummary> summaries = summarize(c);
    EXPECT_NEAR(summaries[1].efficiency->value, 1, 1e-12);
    EXPECT_NEAR(summaries[1].efficiency->interval->low, 1, 1e-12);
}

TEST(MeanRatio, IntervalHoldsOneForAnUnbiasedMethod) {
    const Scene scene = small_scene();
    const TemporaryFolder folder;
    RenderSettings how;
    how.integrator = IntegratorSpec::parse("bdpt");
    how.spp = 256;
    const Reference reference = *make_reference(
        scene, {how, folder.path().string(), 1, 7}, [](const Progress&) {}, kNotInterrupted);
    CompareSettings s = settings_of({"path"}, 64);
    s.sampler = SamplerKind::Independent;
    const MethodSummary m =
        summarize(compare(
                      scene, reference, s, [](const std::string&) {}, kNotInterrupted))
            .front();
    // The seed is fixed; of all seeds one in twenty would fail.
    EXPECT_LE(m.mean_ratio.low, 1);
    EXPECT_GE(m.mean_ratio.high, 1);
    EXPECT_LT(m.mean_ratio.high - m.mean_ratio.low, 0.2);
}

/// A single pass has no spread: several runs have, whose interval is wide.
TEST(MeanRatio, IntervalOfSinglePassesComesFromTheRuns) {
    const Scene scene = small_scene();
    for (const int runs : {1, 2}) {
        CompareSettings s = settings_of({"path"}, 1);
        s.runs = runs;
        const MethodSummary m = summarize(compare(
                                              scene, white_reference(scene), s,
                                              [](const std::string&) {}, kNotInterrupted))
                                    .front();
        EXPECT_EQ(std::isfinite(m.mean_ratio.low), runs > 1);
        EXPECT_EQ(std::isfinite(m.mean_ratio.high), runs > 1);
        EXPECT_LT(m.mean_ratio.low, m.mean_ratio.value);
    }
}

/// The halves of such a reference have one pass each.
TEST(MadeReference, OfTwoSamplesHasTheErrorOfItsHalves) {
    const TemporaryFolder folder;
    RenderSettings how;
    how.integrator = IntegratorSpec::parse("path");
    how.spp = 2;
    const Reference r = *make_reference(
        small_scene(), {how, folder.path().string(), 1, 7}, [](const Progress&) {},
        kNotInterrupted);
    EXPECT_GT(r.mean_error.value, 0);
    EXPECT_EQ(r.mean_error.dof, 1);
}

/// `render` writes no error of the mean after one pass.
TEST(ReadReference, OfOneSampleHasAnUnknownError) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "r.exr").string();
    Image image = rgb_image(8, 8, std::vector<Rgb>(64, Rgb(1)));
    const FilmGeometry film{8, 8, 0, 0, 8, 8};
    write_image(file, image);
    EXPECT_EQ(read_reference(file, film).mean_error.value, 0) << "another program's";
    image.attributes["etendue.mean_luminance"] = 1.0;
    image.attributes["etendue.spp"] = 1.0;
    write_image(file, image);
    EXPECT_FALSE(std::isfinite(read_reference(file, film).mean_error.value));
    image.attributes["etendue.mean_luminance_standard_error"] = 0.5;
    image.attributes["etendue.spp"] = 4.0;
    write_image(file, image);
    EXPECT_EQ(read_reference(file, film).mean_error.value, 0.25);
    EXPECT_EQ(read_reference(file, film).mean_error.dof, 3);
    image.attributes["etendue.mean_luminance_count"] = 2.0;
    write_image(file, image);
    EXPECT_EQ(read_reference(file, film).mean_error.dof, 1);
}

/// They are rendered in less time, for which `auto` would choose without pilots.
TEST(Compare, TechniqueImagesOfAutoAreThoseOfTheMethodThatItChose) {
    const Scene scene = build(front_camera(24) + room() + area_lamp());
    CompareSettings settings = settings_of({"auto:chains=false,max_depth=3"}, 1);
    settings.limits = {.spp = {}, .seconds = 0.5, .error = {}};
    settings.technique_depth = 4;
    const Comparison c = compare(
        scene, white_reference(scene), settings, [](const std::string&) {}, kNotInterrupted);
    ASSERT_EQ(c.failures.size(), 0u);
    const Method& m = c.methods.front();
    ASSERT_TRUE(m.choice);
    const auto techniques = [](const std::vector<TechniqueImages::Entry>& images) {
        std::set<std::pair<int, int>> all;
        for (const auto& e : images) all.insert({e.technique.s, e.technique.t});
        return all;
    };
    RenderSettings own;
    own.integrator = IntegratorSpec::parse(m.choice->chosen);
    own.technique_depth = 4;
    own.spp = m.technique_spp;
    own.sampler = settings.sampler;
    Renderer given(scene, own);
    given.run([](const Progress&) {}, kNotInterrupted);
    EXPECT_EQ(techniques(m.techniques), techniques(given.techniques()->images()))
        << m.choice->chosen;
    EXPECT_GT(m.choice->candidates.front().images, 0);
}

}  // namespace
}  // namespace etendue::test
