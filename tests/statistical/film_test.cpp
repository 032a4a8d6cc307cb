// Filters, crops, the error estimate and the conditions that end a rendering.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// A floor that one lamp lights from the side, seen without perspective.
std::string lit_floor(const std::string& film) {
    return "<sensor type=\"orthographic\"><transform name=\"to_world\"><lookat origin=\"0,0,2\" "
           "target=\"0,0,0\" up=\"0,1,0\"/></transform>"
           "<film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" "
           "value=\"8\"/>" +
           film + "</film></sensor>" + rectangle("<scale value=\"1.6\"/>", diffuse("0.8,0.5,0.3")) +
           "<emitter type=\"point\"><point name=\"position\" value=\"0.7,-0.4,2.2\"/><rgb "
           "name=\"intensity\" value=\"9,8,7\"/></emitter>";
}

class Filters : public ::testing::TestWithParam<const char*> {};

/// Eye paths sampled from the filter and splats weighted with it estimate the same image, also at the border and in a
/// crop. Every pixel is a tile.
TEST_P(Filters, OfEyePathsAndSplatsAgree) {
    const std::string filter = fmt::format("<rfilter type=\"{}\"/>", GetParam());
    const Scene scene = build(lit_floor(filter));
    const Tiles path = render_tiles(scene, "path", {2048, 8, 1});
    expect_same_image(render_tiles(scene, "light", {4096, 8, 2}), path, 0.05, "light");
    expect_same_image(render_tiles(scene, "bdpt", {1024, 8, 3}), path, 0.05, "bdpt");
    for (const char* integrator : {"path", "light", "bdpt"})
        expect_same_image(
            render_tiles(scene, integrator,
                         {.passes = std::string(integrator) == "light" ? 4096u : 1024u,
                          .tiles = 8,
                          .seed = 5,
                          .filter_mode = FilterMode::Spread}),
            path, 0.05, std::string(integrator) + ", spread");

    const Scene crop = build(lit_floor(
        "<integer name=\"crop_offset_x\" value=\"3\"/><integer name=\"crop_offset_y\" value=\"1\"/>"
        "<integer name=\"crop_width\" value=\"4\"/><integer name=\"crop_height\" value=\"4\"/>" +
        filter));
    Tiles part(4);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x)
            for (int c = 0; c < 3; ++c)
                part.values[size_t(3 * (4 * y + x) + c)] =
                    path.values[size_t(3 * (8 * (y + 1) + x + 3) + c)];
    for (const char* integrator : {"path", "light", "bdpt"}) {
        const Tiles cropped = render_tiles(
            crop, integrator, {std::string(integrator) == "light" ? 12288u : 1024u, 4, 4});
        for (size_t c = 0; c < 3; ++c)
            part.values[48 + c] = cropped.values[48 + c];  // the whole has no mean of the part
        expect_same_image(cropped, part, 0.12, std::string(integrator) + " in a crop");
    }
    const Tiles spread = render_tiles(
        crop, "path", {.passes = 1024, .tiles = 4, .seed = 6, .filter_mode = FilterMode::Spread});
    for (size_t c = 0; c < 3; ++c) part.values[48 + c] = spread.values[48 + c];
    expect_same_image(spread, part, 0.12, "path in a crop, spread");
}

INSTANTIATE_TEST_SUITE_P(All, Filters,
                         ::testing::Values("box", "tent", "gaussian", "mitchell", "catmullrom",
                                           "lanczos"),
                         [](const auto& p) { return std::string(p.param); });

class ErrorEstimates : public ::testing::TestWithParam<const char*> {};

/// Compares the mean of Film::error() with the spread of 40 images, where I is their mean. The two may differ by the
/// bias of 1/(I² + …) with I of a single run.
TEST_P(ErrorEstimates, EqualTheTrueError) {
    const Scene scene = build(front_camera(12) + room() + "<emitter type=\"constant\"/>");
    constexpr int kRuns = 40, kPasses = 64;
    std::vector<std::vector<Rgb>> images;
    Moments estimated;
    int covered = 0;
    std::vector<ErrorEstimate> estimates;
    for (int run = 0; run < kRuns; ++run) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(GetParam());
        settings.seed = uint64_t(run);
        settings.threads = 1;
        settings.spp = kPasses;
        Renderer renderer(scene, settings);
        const std::atomic<bool> interrupted{false};
        renderer.run([](const Progress&) {}, interrupted);
        images.push_back(renderer.film().image());
        estimates.push_back(renderer.film().error());
        ASSERT_TRUE(estimates.back().valid);
        estimated.add(estimates.back().relative_rms);
    }
    const size_t pixels = images[0].size();
    std::vector<Moments> pixel(pixels);
    double mean = 0;
    for (size_t i = 0; i < pixels; ++i) {
        for (const auto& image : images) pixel[i].add(double(luminance(image[i])));
        mean += pixel[i].mean() / double(pixels);
    }
    Moments squared;
    for (const Moments& m : pixel)
        squared.add(m.variance() / (m.mean() * m.mean() + 0.01 * mean * mean));
    const double truth = std::sqrt(squared.mean());
    for (const ErrorEstimate& e : estimates) covered += e.low <= truth && truth <= e.high;
    // Fireflies make both heavy-tailed: 10 % either way, and coverage well short of the nominal 95 % of normal samples.
    EXPECT_NEAR(estimated.mean() / truth, 1, 0.1);
    EXPECT_GE(covered, kRuns * 7 / 10)
        << "of " << kRuns << "; true error " << truth << ", estimates " << estimated.mean() << " ± "
        << std::sqrt(estimated.variance());
}

INSTANTIATE_TEST_SUITE_P(Integrators, ErrorEstimates,
                         ::testing::Values("path", "bdpt", "pssmlt:chains=16", "mmlt:chains=48",
                                           "mlt:chains=48"),
                         [](const auto& p) {
                             const std::string name = p.param;
                             return name.substr(0, name.find(':'));
                         });

class Stop : public ::testing::Test {
protected:
    Stop() : scene(build(front_camera(12) + room() + area_lamp())) { settings.threads = 1; }
    StopReason run(Renderer& renderer) {
        return renderer.run([](const Progress&) {}, interrupted);
    }

    Scene scene;
    RenderSettings settings;
    std::atomic<bool> interrupted{false};
};

TEST_F(Stop, AfterSamples) {
    settings.spp = 5;
    Renderer renderer(scene, settings);
    EXPECT_EQ(run(renderer), StopReason::Samples);
    EXPECT_EQ(renderer.film().passes(), 5u);
}

TEST_F(Stop, AfterTime) {
    settings.seconds = 0.3;
    Renderer renderer(scene, settings);
    EXPECT_EQ(run(renderer), StopReason::Time);
    const double pass = renderer.seconds() / double(renderer.film().passes());
    EXPECT_NEAR(renderer.seconds(), 0.3, std::max(3 * pass, 0.1));
}

TEST_F(Stop, AtError) {
    settings.error = 0.15;
    settings.spp = 100000;
    Renderer renderer(scene, settings);
    EXPECT_EQ(run(renderer), StopReason::Error);
    EXPECT_LE(renderer.film().error().relative_rms, 0.15);
    EXPECT_GT(renderer.film().error().relative_rms, 0.12) << "it should not go on for long";
}

TEST_F(Stop, WhenInterrupted) {
    settings.spp = 1000;
    Renderer renderer(scene, settings);
    EXPECT_EQ(renderer.run([&](const Progress& p) { interrupted = p.passes == 3; }, interrupted),
              StopReason::Interrupted);
    EXPECT_EQ(renderer.film().passes(), 3u);
}

}  // namespace
}  // namespace etendue::test
