// Shapes and images are loaded by several threads: scenes, warnings and errors do not depend on them.

#include <sched.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "scene/builder.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class Preloading : public ::testing::Test {
protected:
    fs::path folder_ = fs::temp_directory_path() / fmt::format("etendue-preload-{}", getpid());

    Preloading() { fs::create_directory(folder_); }
    ~Preloading() override { fs::remove_all(folder_); }

    void write(const std::string& name, const std::string& text) const {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    /// A mesh of one triangle, and of `flat` triangles without area.
    void write_mesh(const std::string& name, int flat) const {
        std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        for (int i = 0; i < flat; ++i) text += "f 1 2 2\n";
        write(name, text);
    }
    /// An image of one grey pixel.
    void write_image(const std::string& name, float value) const {
        std::string bytes = "Pf\n1 1\n-1.0\n";
        bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
        write(name, bytes);
    }
    SceneDescription parse(const std::string& contents) const {
        return parse_mitsuba_xml("<scene version=\"3.0.0\">" + front_camera(4) +
                                     "<emitter type=\"constant\"/>" + contents + "</scene>",
                                 (folder_ / "scene.xml").string());
    }
    /// Calls `use` with options of 1 thread and of 8, several times.
    template <class Use>
    void for_threads(const Use& use) const {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 8);
        for (const int threads : {1, 8, 8, 8, 8}) {
            SCOPED_TRACE(fmt::format("{} threads", threads));
            BuildOptions options;
            options.threads = threads;
            use(options);
        }
    }
};

std::string mesh(const std::string& file, const std::string& bsdf = "") {
    return fmt::format("<shape type=\"obj\"><string name=\"filename\" value=\"{}\"/>{}</shape>\n",
                       file, bsdf);
}

std::string picture(const std::string& file) {
    return fmt::format("<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\">"
                       "<string name=\"filename\" value=\"{}\"/></texture></bsdf>",
                       file);
}

TEST_F(Preloading, ShapesAndImagesKeepTheirOrder) {
    std::string contents;
    for (int i = 0; i < 40; ++i) {
        // The first files take the longest.
        const std::string name = fmt::format("{}.obj", i), image = fmt::format("{}.pfm", i);
        write_mesh(name, 40 * (40 - i));
        write_image(image, float(i) / 40);
        contents += mesh(name, picture(image));
    }
    const SceneDescription scene = parse(contents);
    for_threads([&](const BuildOptions& options) {
        const Scene built = build_scene(scene, options);
        ASSERT_EQ(built.shapes().size(), 40u);
        ASSERT_EQ(built.warnings().size(), 40u);
        for (size_t i = 0; i < 40; ++i) {
            EXPECT_EQ(built.shapes()[i].material->mean_albedo(), Rgb(float(i) / 40));
            EXPECT_NE(built.warnings()[i].find(
                          fmt::format("{}.obj: {} triangles of zero area", i, 40 * (40 - i))),
                      std::string::npos)
                << built.warnings()[i];
        }
    });
}

TEST_F(Preloading, TheFirstErrorOfTheFileIsReported) {
    write_mesh("good.obj", 1000);
    write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    write("bad.png", "not an image");
    const auto error_of = [&](const std::string& contents, const BuildOptions& options) {
        try {
            build_scene(parse(contents), options);
            return std::string("no error");
        } catch (const std::exception& e) {
            return std::string(e.what());
        }
    };
    const std::string wrong_bsdf = "<bsdf type=\"no_such\"/>";
    const std::pair<std::string, const char*> cases[] = {
        {mesh("good.obj") + mesh("bad.obj") + mesh("missing.obj"), "bad.obj:2: "},
        {mesh("good.obj") + mesh("missing.obj") + mesh("bad.obj"), "there is no file \"missing"},
        {mesh("good.obj", picture("bad.png")) + mesh("bad.obj"), "bad.png"},
        {mesh("good.obj", picture("missing.png")) + mesh("bad.obj"), "missing.png"},
        {mesh("bad.obj", picture("bad.png")), "bad.obj:2: "},
        {mesh("good.obj", wrong_bsdf) + mesh("bad.obj"), "unknown bsdf \"no_such\""},
    };
    for_threads([&](const BuildOptions& options) {
        for (const auto& [contents, expected] : cases) {
            const std::string error = error_of(contents, options);
            EXPECT_NE(error.find(expected), std::string::npos) << error;
        }
    });
}

TEST_F(Preloading, LenientReportsEverythingInTheOrderOfTheFile) {
    write_mesh("good.obj", 3);
    write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    write("bad.png", "not an image");
    const SceneDescription scene =
        parse(mesh("missing.obj") + mesh("good.obj", picture("bad.png")) + mesh("bad.obj") +
              mesh("good.obj", picture("bad.png")));
    for_threads([&](BuildOptions options) {
        options.lenient = true;
        const Scene built = build_scene(scene, options);
        const char* expected[] = {"missing.obj", "3 triangles of zero area", "bad.png",
                                  "bad.obj:2: ", "3 triangles of zero area", "bad.png"};
        const auto& warnings = built.warnings();
        ASSERT_GE(warnings.size(), std::size(expected));
        for (size_t i = 0; i < std::size(expected); ++i)
            EXPECT_NE(warnings[i].find(expected[i]), std::string::npos) << i << ": " << warnings[i];
    });
}

/// How often the scheduler has taken the processor from each other thread of this process, once all of them are idle.
std::map<std::string, std::string> switches_of_idle_threads() {
    std::map<std::string, std::string> switches, before;
    do {
        before = std::exchange(switches, {});
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        for (const auto& task : fs::directory_iterator("/proc/self/task")) {
            std::ifstream in(task.path() / "status");
            for (std::string line; std::getline(in, line);)
                if (line.find("ctxt_switches") != line.npos)
                    switches[task.path().filename()] += line;
        }
        switches.erase(fs::read_symlink("/proc/thread-self").filename());
    } while (switches != before);
    return switches;
}

/// Without a number, as many threads as the process may use: its affinity, which changes here after TBB has begun, or the
/// quota of a control group.
TEST_F(Preloading, HasTheThreadsThatTheProcessMayUse) {
    std::string contents;
    for (int i = 0; i < 60; ++i) {
        write_mesh(fmt::format("{}.obj", i), 2000);
        contents += mesh(fmt::format("{}.obj", i));
    }
    const SceneDescription scene = parse(contents);
    const auto helpers_of_build = [&] {
        const auto before = switches_of_idle_threads();
        build_scene(scene);
        int helpers = 0;
        for (const auto& [thread, switches] : switches_of_idle_threads()) {
            const auto old = before.find(thread);
            helpers += old == before.end() || old->second != switches;
        }
        return helpers;
    };
    cpu_set_t all, one;
    ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
    CPU_ZERO(&one);
    for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i)
        if (CPU_ISSET(i, &all)) CPU_SET(i, &one);
    if (CPU_COUNT(&all) > 1) {
        EXPECT_GT(helpers_of_build(), 0);
    }
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    const int helpers = helpers_of_build();
    sched_setaffinity(0, sizeof all, &all);
    EXPECT_EQ(helpers, 0);
}

// The second reference to a shape makes it again.
TEST_F(Preloading, AShapeMayBeUsedTwice) {
    write_mesh("a.obj", 1);
    const SceneDescription scene =
        parse("<shape type=\"merge\"><shape type=\"obj\" id=\"a\"><string name=\"filename\" "
              "value=\"a.obj\"/></shape></shape>"
              "<shape type=\"merge\"><ref id=\"a\"/></shape>");
    const Scene built = build_scene(scene);
    EXPECT_EQ(built.shapes().size(), 2u);
    EXPECT_EQ(built.warnings().size(), 2u);
}

}  // namespace
}  // namespace etendue::test
