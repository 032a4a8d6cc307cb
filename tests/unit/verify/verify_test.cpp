// verify() as a whole, on scenes of a few pixels.

#include "verify/verify.h"

#include <atomic>

#include <gtest/gtest.h>

#include "limited_memory.h"
#include "system/available_memory.h"
#include "system/memory_limit.h"
#include "test_scenes.h"
#include "verify/run_series.h"

namespace etendue::test {
namespace {

std::string lit_room(int size) {
    return front_camera(size) + room() + area_lamp();
}

VerifyOptions quick_options() {
    VerifyOptions options;
    options.longest = 3;
    options.runs = 8;
    options.threads = 2;
    options.spp = 16;
    return options;
}

/// An exception of a rendering reaches the caller and does not terminate the program.
TEST(Verify, ThrowsWhatARenderingThrows) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    options.spp = 1;
    options.longest = 8;
    try {
        verify(scene, {IntegratorSpec::parse("vcm:memory=1,light_paths=40000")}, options);
        FAIL() << "expected an error";
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("more than 1 MiB"), std::string::npos) << e.what();
    }
}

/// There is no memory for the stacks of 64 threads.
TEST(Verify, RunsOnAsManyThreadsAsThereCanBe) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    EXPECT_EQ(
        in_limited_memory(uint64_t(1) << 30,
                          [] {
                              const Scene scene = build(lit_room(8));
                              VerifyOptions options = quick_options();
                              options.runs = options.threads = 64;
                              options.spp = 1;
                              const SeriesRenderer::Report silent;
                              SeriesRenderer series(scene, options, silent);
                              RunSeries runs = series.begin(IntegratorSpec::parse("path"), 1, 1, 0);
                              limit_memory(memory_for_data("/proc").value() + (uint64_t(60) << 20));
                              series.extend(runs, 1);
                              for (const IndependentRun& run : runs.runs)
                                  if (run.pixels.size() != 64)
                                      throw std::runtime_error("a run is missing");
                          }),
        "");
}

/// Whenever it ends, what it reports is what it would have reported of these methods anyway.
TEST(Verify, KeepsWhatWasCompleteWhenItIsInterrupted) {
    const Scene scene = build(lit_room(8));
    const std::vector<IntegratorSpec> methods{IntegratorSpec::parse("path"),
                                              IntegratorSpec::parse("bdpt")};
    VerifyOptions options = quick_options();
    options.spp = 4;
    options.against = {IntegratorSpec::parse("path")};
    int lines = 0;
    const VerifyReport whole =
        verify(scene, methods, options, {}, [&](const std::string&) { ++lines; });
    EXPECT_FALSE(whole.interrupted);
    ASSERT_EQ(whole.methods.size(), 2u);
    size_t most = 0;
    // Not the last runs, which may be over when the flag is set.
    for (int stop_at = 1; stop_at < lines - 4; stop_at += 3) {
        std::atomic<bool> interrupted{false};
        options.interrupted = &interrupted;
        int line = 0;
        const VerifyReport report = verify(scene, methods, options, {}, [&](const std::string&) {
            if (++line == stop_at) interrupted = true;
        });
        EXPECT_TRUE(report.interrupted);
        EXPECT_LT(line, stop_at + 3);
        ASSERT_LT(report.methods.size(), 2u) << stop_at;
        EXPECT_GE(report.methods.size(), most) << "fewer than when it was interrupted earlier";
        most = report.methods.size();
        if (report.methods.empty()) continue;
        EXPECT_EQ(report.methods[0].method, "path");
        EXPECT_EQ(report.methods[0].image[1].p, whole.methods[0].image[1].p);
        EXPECT_EQ(report.methods[0].lengths[1].comparison.p,
                  whole.methods[0].lengths[1].comparison.p);
    }
    EXPECT_EQ(most, 1u);
}

TEST(Verify, KeepsRenderingsOfAnInterruptedSearch) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    options.spp = 4;
    options.detect = 1e-4;
    options.against = {IntegratorSpec::parse("path")};
    std::atomic<bool> interrupted{false};
    options.interrupted = &interrupted;
    int plans = 0;
    const VerifyReport report =
        verify(scene, {IntegratorSpec::parse("path")}, options, {}, [&](const std::string& line) {
            plans += line.find("s more") != line.npos;
            if (plans == 3) interrupted = true;
        });
    EXPECT_TRUE(report.interrupted);
    ASSERT_EQ(report.methods.size(), 1u);
    EXPECT_GT(report.methods[0].spp, 4u);
    EXPECT_TRUE(report.methods[0].image[1].is_tested());
}

/// All renderings of a reference have the same method.
TEST(Verify, ReferencesAreChosenOnce) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    options.spp = 1;
    options.against = {IntegratorSpec::parse("path:guide=auto"), IntegratorSpec::parse("auto")};
    const VerifyReport report = verify(scene, {IntegratorSpec::parse("bdpt")}, options);
    EXPECT_NE(report.reference.find("guide=off"), std::string::npos) << report.reference;
    EXPECT_EQ(report.reference.find("auto"), std::string::npos) << report.reference;
}

TEST(Verify, LeavesOutMethodsThatFail) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    options.spp = 1;
    for (const char* first : {"path", "vcm:memory=1,light_paths=40000"}) {
        const char* second =
            first == std::string("path") ? "vcm:memory=1,light_paths=40000" : "path";
        const VerifyReport report =
            verify(scene, {IntegratorSpec::parse(first), IntegratorSpec::parse(second)}, options);
        ASSERT_EQ(report.methods.size(), 1u);
        EXPECT_EQ(report.methods[0].method, "path");
        ASSERT_EQ(report.failures.size(), 1u);
        EXPECT_TRUE(report.failures[0].starts_with("vcm:")) << report.failures[0];
    }
}

TEST(Verify, SamplersGiveTheSameMeans) {
    const Scene scene = build(lit_room(8));
    std::vector<double> means;
    for (const SamplerKind sampler : {SamplerKind::Sobol, SamplerKind::Independent}) {
        VerifyOptions options = quick_options();
        options.sampler = sampler;
        options.spp = 48;
        const VerifyReport report = verify(scene, {IntegratorSpec::parse("bdpt")}, options);
        EXPECT_EQ(report.verdict(report.methods[0]), Verdict::Consistent);
        means.push_back(report.methods[0].image[1].method.mean());
    }
    EXPECT_NE(means[0], means[1]);
    EXPECT_NEAR(means[0] / means[1], 1, 0.05);
}

/// Rendering continues until the requested error would be found, within the time limit.
TEST(Verify, RendersUntilAnErrorWouldBeFound) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    options.spp = 4;
    options.detect = 0.05;
    const VerifyReport report = verify(scene, {IntegratorSpec::parse("bdpt")}, options);
    const MethodReport& m = report.methods[0];
    const Detectable found = report.detectable(m);
    EXPECT_TRUE(found.reaches(0.05));
    EXPECT_LE(*found.image, 0.05);
    EXPECT_LE(*found.length, 0.05);
    EXPECT_GT(m.spp, 4u);
    EXPECT_EQ(m.spp % 4, 0u);
    EXPECT_EQ(report.verdict(m), Verdict::Consistent);

    options.detect = 1e-4;
    options.seconds = 0.5;
    const VerifyReport unfinished = verify(scene, {IntegratorSpec::parse("bdpt")}, options);
    EXPECT_FALSE(unfinished.detectable(unfinished.methods[0]).reaches(1e-4));
}

/// Light seen in a mirror is out of reach of `light`; the report names these classes and their share of the light.
TEST(Verify, NamesWhatIsNotCompared) {
    const Scene scene =
        build(lit_room(12) + sphere("0,-0.3,0.2", "0.6",
                                    "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>"));
    const VerifyReport report = verify(scene, {IntegratorSpec::parse("light")}, quick_options());
    const MethodReport& m = report.methods[0];
    ASSERT_FALSE(m.untested.empty());
    EXPECT_EQ(to_string(m.untested[0].path_class).back(), 'E');
    double out_of_reach = 0, too_rare = 0;
    for (const UntestedClass& c : m.untested) {
        (c.is_out_of_reach ? out_of_reach : too_rare) += c.share;
        EXPECT_TRUE(!c.is_out_of_reach || c.path_class.delta_events != 0)
            << to_string(c.path_class);
    }
    EXPECT_NEAR(out_of_reach, m.out_of_reach, 1e-9);
    EXPECT_NEAR(too_rare, m.too_rare, 1e-9);
    EXPECT_GT(m.out_of_reach, 0.01);
}

/// A lamp so small that hits never find it, under a sky whose light they find often: they do not seem rare.
TEST(Verify, KnowsWhatHitsAloneWouldHaveToFind) {
    const Scene scene =
        build(front_camera(8) + room() +
              sphere("0,0.5,0", "0.002",
                     "<emitter type=\"area\"><rgb name=\"radiance\" value=\"1e6\"/></emitter>") +
              "<emitter type=\"constant\"/>");
    VerifyOptions options = quick_options();
    options.spp = 256;
    const VerifyReport report = verify(scene, {IntegratorSpec::parse("path")}, options);
    int hits = 0, tested = 0;
    for (const TechniqueReport& t : report.methods[0].techniques) {
        EXPECT_FALSE(report.deviates(t.comparison)) << t.technique.s << ',' << t.technique.t;
        tested += t.comparison.is_tested();
        if (t.technique != Technique{Strategy::Hit, 0, 3}) continue;
        ++hits;
        EXPECT_FALSE(t.comparison.is_tested());
    }
    EXPECT_EQ(hits, 1);
    EXPECT_GT(tested, 0);
}

/// Correlated pixels increase the error of a reference's mean.
TEST(Verify, AllowsForCorrelatedPixelsOfAReference) {
    const Scene scene = build(lit_room(8));
    VerifyOptions options = quick_options();
    ReferenceImage image{"image", std::vector<Rgb>(64, Rgb(0.5f)), std::vector<Rgb>(64, Rgb(0.01f)),
                         100};
    const auto error = [&] {
        return verify(scene, {IntegratorSpec::parse("path")}, options, image)
            .methods[0]
            .image[0]
            .reference.squared_error();
    };
    const double independent = error();
    image.correlation = 5;
    EXPECT_NEAR(error(), 5 * independent, 1e-9);
}

TEST(Verify, MethodsWithChainsAreAlsoVerifiedWithLongOnes) {
    const auto specs = [](const std::vector<const char*>& names) {
        std::vector<IntegratorSpec> out;
        for (const char* name : names) out.push_back(IntegratorSpec::parse(name));
        return out;
    };
    const auto all =
        with_long_chains(specs({"mlt:max_depth=4", "path", "mmlt:groups=4", "pssmlt:p_large=0.5"}));
    std::vector<std::string> names;
    for (const IntegratorSpec& s : all) names.push_back(s.to_string());
    const std::vector<std::string> expected{"mlt:max_depth=4",
                                            "mlt:chains=16,groups=2,max_depth=4,p_large=0.02",
                                            "path",
                                            "mmlt:groups=4",
                                            "pssmlt:p_large=0.5",
                                            "pssmlt:chains=16,groups=2,p_large=0.5"};
    EXPECT_EQ(names, expected);

    VerifyOptions options = quick_options();
    options.spp = 32;
    const VerifyReport report = verify(build(lit_room(8)), specs({"mlt"}), options);
    ASSERT_EQ(report.methods.size(), 2u);
    for (const MethodReport& m : report.methods)
        EXPECT_NE(report.verdict(m), Verdict::Deviates) << m.method;
}

}  // namespace
}  // namespace etendue::test
