// Limits of a rendering: numbers of passes, memory, and how soon a pass can be dropped.

#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "error_of.h"
#include "image/image_io.h"
#include "limited_memory.h"
#include "render/render_report.h"
#include "render/renderer.h"
#include "render/warnings.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene small_scene(int width = 8, const std::string& filter = "box") {
    BuildOptions options;
    options.resolution = {width, width};
    return build_scene(parse_mitsuba_xml("<scene version=\"3.0.0\">" +
                                             with_filter(front_camera(8), filter) + room() +
                                             area_lamp() + "</scene>",
                                         "test.xml"),
                       options);
}

TEST(RenderLimits, PassesHaveRandomNumbersOfTheirOwn) {
    const Scene scene = small_scene();
    RenderSettings settings;
    settings.spp = (uint64_t(1) << 32) + 1;
    const std::string error = error_of([&] { Renderer(scene, settings); });
    EXPECT_NE(error.find("4294967297 samples per pixel are too many"), std::string::npos) << error;
    settings.spp = uint64_t(1) << 32;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    EXPECT_NE(error_of([&] {
                  renderer.run(
                      {.spp = uint64_t(1) << 40, .seconds = {}, .error = {}},
                      [](const Progress&) {}, interrupted);
              }).find("too many"),
              std::string::npos);
}

TEST(RenderLimits, ImagesMustFitIntoTheMemory) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    const Scene scene = small_scene(16384);
    RenderSettings settings;
    settings.threads = 1;
    const std::string verdict =
        in_limited_memory(uint64_t(2) << 30, [&] { Renderer(scene, settings); });
    const std::string begin = "an image of 16384 x 16384 pixels needs ";
    ASSERT_TRUE(verdict.starts_with(begin)) << verdict;
    // 2^28 pixels.
    const double gib = std::stod(verdict.substr(begin.size()));
    EXPECT_NEAR(gib, double(Film::bytes_per_pixel(false, 0)) / 4, 0.1) << verdict;
    EXPECT_NE(verdict.find(" GiB of memory, but only "), std::string::npos) << verdict;
    EXPECT_TRUE(verdict.ends_with(" GiB are free; render it in crops (--crop)")) << verdict;
}

/// Renders and writes in no more than the memory that the film says it needs, apart from what does not grow with it.
TEST(RenderLimits, FilmsNeedNoMoreThanTheySay) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    constexpr int kSize = 1024;
    constexpr uint64_t kRest = uint64_t(24) << 20;
    const Scene box = small_scene(kSize), wide = small_scene(kSize, "gaussian");
    const std::string file = ::testing::TempDir() + "etendue-limits.exr";
    for (const char* name : {"path", "light", "path of a wide filter"}) {
        SCOPED_TRACE(name);
        const bool is_wide = std::string(name).ends_with("filter");
        const Scene& scene = is_wide ? wide : box;
        RenderSettings settings;
        settings.integrator =
            IntegratorSpec::parse((is_wide ? "path" : std::string(name)) + ":max_depth=2");
        settings.threads = 1;
        const bool has_splats = std::string(name) == "light";
        const uint64_t bytes = Film::bytes_per_pixel(has_splats, 0) * kSize * kSize + kRest;
        const auto render = [&] {
            Renderer renderer(scene, settings);
            const std::atomic<bool> interrupted{false};
            renderer.run(
                {.spp = 2, .seconds = {}, .error = {}}, [](const Progress&) {}, interrupted);
            write_image(file, image_rows(renderer.film(), {}, true, nlohmann::json::object()));
        };
        EXPECT_EQ(in_limited_memory(bytes, render), "");
        EXPECT_NE(in_limited_memory(bytes - 2 * kRest, render), "") << "the limit limits nothing";
    }
    std::filesystem::remove(file);
}

TEST(RenderLimits, LightPathsThatMayNotFitAreNamedBefore) {
    const Scene scene = small_scene(2048);
    const auto warned = [&](const char* text, uint64_t light_paths, uint64_t available) {
        const IntegratorSpec spec = IntegratorSpec::parse(text);
        return memory_warnings(scene, spec.name, *make_integrator(spec), light_paths, available);
    };
    constexpr uint64_t kGiB = uint64_t(1) << 30;
    EXPECT_TRUE(warned("upg", 1 << 22, 8 * kGiB).empty());
    EXPECT_TRUE(warned("upg:memory=1000", 1 << 22, kGiB).empty());
    for (const char* name : {"path", "bdpt", "mlt"}) EXPECT_TRUE(warned(name, 1 << 22, 1).empty());
    for (const char* name : {"upg", "upg+pssmlt", "vcm", "sppm", "pcbpt", "pm"}) {
        const auto all = warned(name, 1 << 22, 2 * kGiB);
        ASSERT_EQ(all.size(), 1u) << name;
        EXPECT_EQ(all[0], std::string(name) +
                              " may need up to 6.0 GiB for its light paths, but only 2.0 GiB of "
                              "memory are free; memory=1536 limits it, and there are fewer light "
                              "paths then");
    }
}

TEST(RenderLimits, RenderersNameTheLightPathsThatMayNotFit) {
    const Scene scene = small_scene(64);
    for (const char* method : {"path", "upg"}) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(method);
        const Renderer renderer(scene, settings);
        EXPECT_EQ(memory_warnings(renderer, 1 << 20).size(), method == std::string("upg"));
        EXPECT_TRUE(memory_warnings(renderer, uint64_t(1) << 33).empty());
    }
}

/// A closed room whose walls reflect all light: only roulette ends its paths.
Scene white_room() {
    return build(sensor("0,0,3", "0,0,0", 64) +
                 "<shape type=\"sphere\"><float name=\"radius\" value=\"10\"/><boolean "
                 "name=\"flip_normals\" value=\"true\"/>" +
                 diffuse("1,1,1") + "</shape>" + area_lamp("1,1,1"));
}

TEST(RenderLimits, PassesOfLongPathsAreDroppedAtOnce) {
    const Scene scene = white_room();
    for (const char* method :
         {"path:rr_depth=1000", "bdpt:rr_depth=100,max_depth=1000000",
          "bdpt:light_paths=1000000000", "mlt", "mlt:chains=1,groups=2,mutations=1024"}) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(method);
        settings.threads = 2;
        settings.spp = 1000000;
        Renderer renderer(scene, settings);
        std::atomic<bool> stop{false}, drop{false};
        using Clock = std::chrono::steady_clock;
        Clock::time_point dropped;
        std::thread user([&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
            stop = drop = true;
            dropped = Clock::now();
        });
        renderer.run([](const Progress&) {}, stop, drop);
        const double seconds = std::chrono::duration<double>(Clock::now() - dropped).count();
        user.join();
        EXPECT_LT(seconds, 1) << method;
    }
}

// Densities of vertices are relative to the size of the scene.
TEST(RenderLimits, PathsInASmallPartOfTheSceneCount) {
    const auto room_in = [](const std::string& camera, const char* far) {
        return build(
            camera +
            "<shape type=\"sphere\"><float name=\"radius\" value=\"10\"/><boolean "
            "name=\"flip_normals\" value=\"true\"/>" +
            diffuse("1,1,1") + "</shape>" + area_lamp("1,1,1") +
            rectangle("<scale value=\"1000000\"/><translate x=\"" + std::string(far) + "\"/>",
                      diffuse("1,1,1")));
    };
    const Scene longer = room_in(sensor("0,0,3", "0,0,0", 8), "10000000"),
                larger = room_in(lens_camera(8), "1000000000");
    const std::pair<const Scene*, const char*> cases[] = {
        {&longer, "mlt:groups=2,max_depth=60"},
        {&longer, "mps:target=path,mutations=500,precision=0.2,max_depth=60"},
        {&larger, "mlt:groups=2,max_depth=60"}};
    for (const auto& [scene, method] : cases) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(method);
        settings.spp = 4;
        Renderer renderer(*scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        EXPECT_EQ(renderer.stats().rejected, 0u) << method;
    }
}

}  // namespace
}  // namespace etendue::test
