// User paths on the command line: picked, checked, and given to mlt.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

std::string rectangle(const std::string& id, const std::string& transform,
                      const std::string& more) {
    return fmt::format("<shape type=\"rectangle\" id=\"{}\"><transform name=\"to_world\">{}"
                       "</transform>{}</shape>\n",
                       id, transform, more);
}

/// A lamp above a floor, a shelf between them, and a mirror on the left. `parameters` are of the integrator.
std::string scene_text(const std::string& parameters = "") {
    return "<scene version=\"3.0.0\">\n<integrator type=\"mlt\">" + parameters +
           "<integer name=\"max_depth\" value=\"6\"/><integer name=\"rr_depth\" value=\"5\"/>"
           "</integrator>\n"
           "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform "
           "name=\"to_world\"><lookat origin=\"0,0,3\" target=\"0,-0.3,0\" up=\"0,1,0\"/>"
           "</transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/><integer "
           "name=\"height\" value=\"16\"/></film></sensor>\n" +
           rectangle("floor", "<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>", "") +
           rectangle("lamp",
                     "<scale value=\"0.3\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>",
                     "<emitter type=\"area\"/>") +
           rectangle("shelf",
                     "<scale value=\"0.2\"/><rotate x=\"1\" angle=\"-90\"/><translate x=\"0.5\"/>",
                     "") +
           rectangle("mirror", "<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>",
                     "<bsdf type=\"conductor\"/>") +
           "</scene>\n";
}

class PathsTest : public ::testing::Test {
protected:
    PathsTest() {
        write(scene, scene_text());
        write(paths, R"([{"name": "straight", "points": [[0, 1, 0], [0.1, -1, 0.3]]},
 {"name": "mirrored", "points": [[0, 1, 0], [-1, 0, 0], [0, -1, 0]], "cone": [2, 1]}])");
    }
    static void write(const fs::path& file, const std::string& text) {
        std::ofstream(file) << text;
    }
    ProgramResult run(const std::vector<std::string>& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    ProgramResult render(const std::string& integrator) const {
        std::vector<std::string> arguments{"render", scene,     "-o",  image,    "--spp",
                                           "2",      "--stats", stats, "--quiet"};
        if (!integrator.empty()) arguments.insert(arguments.end(), {"-i", integrator});
        return run(arguments);
    }
    nlohmann::json report() const { return nlohmann::json::parse(read_text(stats)); }

    TemporaryFolder folder;
    fs::path scene = folder.path() / "scene.xml", paths = folder.path() / "paths.json",
             image = folder.path() / "image.pfm", stats = folder.path() / "stats.json";
};

TEST_F(PathsTest, ThatAreGoodPassTheCheck) {
    const ProgramResult r = run({"paths", scene, "--check", paths});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(r.errors, "");
    EXPECT_NE(r.output.find("2 of 2 paths can be used"), std::string::npos) << r.output;
}

TEST_F(PathsTest, OnePathIsNotCalledPaths) {
    write(paths, R"([{"points": [[0, 1, 0], [0.1, -1, 0.3]]}])");
    EXPECT_NE(run({"paths", scene, "--check", paths}).output.find("1 of 1 path can be used"),
              std::string::npos);
    const fs::path picked = folder.path() / "picked.json";
    const ProgramResult r = run({"paths", scene, "--pick", "1", "--pixel", "8,12", "--length", "3",
                                 "--samples", "20000", "-o", picked});
    EXPECT_EQ(r.output, picked.string() + ": 1 path\n") << r.errors;
}

TEST_F(PathsTest, ThatCannotBeUsedAreRefusedWithTheirReasons) {
    const std::vector<std::pair<std::string, std::string>> refused{
        {"[0, 1, 0], [0.1, -0.9, 0.3]", "2: is 0.1 from the nearest surface, \"floor\""},
        {"[0, 1, 0], [0.1, -1, 0.3], [9, 9, 9]", "3: there is no surface near it"},
        {"[0, 1, 0], [1, -1, 0]",
         "2: cannot be reached from the point before it: \"shelf\" at (0."},
        {"[0, 1, 0], [-1, 0, 0], [0, -1, 0.25]", "2: on \"mirror\", the path is 10 degrees off the "
                                                 "law of reflection; at most 2 are allowed"},
        {"[0, 1, 0], [-1, 0, 0]", "2: is on \"mirror\", a mirror or clear glass"},
        {"[0, 1, 0], [0.5, 0, 0], [0.6, -1, 0]",
         "2: \"shelf\" scatters nothing from the point before it to the point after it"},
        {"[0.5, 0, 0], [0.1, -1, 0.3]", "1: is on \"shelf\", which emits nothing"},
        {"[0, 1, 0], [0.2, 1, 0]", "1: its emitter emits nothing toward the next point"}};
    std::string text = "[{\"points\": [[0, 1, 0], [0.1, -1, 0.3]]}";
    for (const auto& [points, reason] : refused)
        text += ",\n {\"name\": \"bad\", \"points\": [" + points + "]}";
    write(paths, text + "]");
    const ProgramResult r = run({"paths", scene, "--check", paths});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.output.find("1 of 9 paths can be used"), std::string::npos) << r.output;
    EXPECT_EQ(r.output.find("path 1"), std::string::npos) << r.output;
    // The same where they are to be used, and nothing is rendered.
    write(image, "an earlier picture");
    const ProgramResult rendered = render("mlt:user_paths=" + paths.string());
    EXPECT_EQ(rendered.status, 1);
    EXPECT_EQ(read_text(image), "an earlier picture");
    for (size_t i = 0; i < refused.size(); ++i) {
        const std::string message =
            fmt::format("{}: path {} \"bad\", point {}", paths.string(), i + 2, refused[i].second);
        EXPECT_NE(r.output.find(message), std::string::npos) << message << "\n" << r.output;
        EXPECT_NE(rendered.errors.find(message), std::string::npos) << rendered.errors;
    }
}

TEST_F(PathsTest, BadFilesAreRefused) {
    const auto expect = [&](const std::string& file, const std::string& message) {
        for (const ProgramResult& r :
             {run({"paths", scene, "--check", file}), render("mlt:user_paths=" + file)}) {
            EXPECT_EQ(r.status, 1);
            EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
            EXPECT_EQ(r.output, "");
            EXPECT_FALSE(fs::exists(image));
        }
    };
    expect(folder.path() / "none.json", "none.json: cannot read: No such file or directory");
    write(paths, "[\n{\"points\": [[0, 1, 0], [0.1, -1, 0.3]}\n]");
    expect(paths, "paths.json:2: malformed JSON");
    expect(folder.path(), "cannot read: Is a directory");
    write(paths, "[{\"points\":" + std::string(100000, '[') + "]");
    expect(paths, "paths.json:1: values are nested more than 64 deep");
    write(paths, "[{\"points\": [[1e999, 0, 0], [0, 0, 0]]}]");
    expect(paths, "paths.json:1: malformed JSON: the number 1e999 is too large");
    write(paths, "[]");
    expect(paths, "paths.json: has no paths");
    write(paths, "[{\"points\": [[0, 1, 0]]}]");
    expect(paths, "paths.json: path 1 needs at least two points");
}

TEST_F(PathsTest, PickedOnesAreUsed) {
    const fs::path picked = folder.path() / "picked.json";
    const ProgramResult r = run({"paths", scene, "--pick", "3", "--pixel", "8,12", "--length", "3",
                                 "--samples", "20000", "-o", picked});
    ASSERT_EQ(r.status, 0) << r.errors;
    const auto list = nlohmann::json::parse(read_text(picked));
    ASSERT_EQ(list.size(), 3u);
    for (const auto& path : list) EXPECT_EQ(path["points"].size(), 3u);
    EXPECT_EQ(run({"paths", scene, "--check", picked}).status, 0);
    const ProgramResult rendered = render("mlt:user_paths=" + picked.string());
    EXPECT_EQ(rendered.status, 0) << rendered.errors;
    EXPECT_GT(report()["user_path_proposed"], 0);
}

TEST_F(PathsTest, PickRefusesWhatItCannotDo) {
    const auto expect = [&](const std::vector<std::string>& options, const std::string& message) {
        std::vector<std::string> all{"paths", scene};
        all.insert(all.end(), options.begin(), options.end());
        const std::string before = read_text(paths);
        const ProgramResult r = run(all);
        EXPECT_NE(r.status, 0);
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_EQ(read_text(paths), before);
    };
    expect({}, "expected either --pick N or --check FILE");
    expect({"--pick", "3", "-o", paths}, "--pick needs --pixel x,y and -o FILE");
    EXPECT_EQ(run({"paths", scene, "--pick", "3"}).status, 2);
    expect({"--pick", "3", "--pixel", "16,2", "-o", paths}, "pixel 16,2 lies outside the image");
    expect({"--pick", "3", "--pixel", "8,0", "--length", "2", "--samples", "100", "-o", paths},
           "none of 100 samples found light for pixel 8,0");
}

/// The file's name is relative to the scene. Other integrators take what they know of the scene's.
TEST_F(PathsTest, MayBeNamedInTheScene) {
    write(scene, scene_text("<string name=\"user_paths\" value=\"paths.json\"/>"));
    ProgramResult r = render("");
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_GT(report()["user_path_proposed"], 0);
    for (const char* other : {"bdpt", "mmlt"}) EXPECT_EQ(render(other).status, 0) << other;
    EXPECT_EQ(render("mlt:user_ratio=2").status, 0);
    EXPECT_GT(report()["user_path_proposed"], 0);
    // An empty name leaves them out.
    ASSERT_EQ(render("mlt:user_paths=").status, 0);
    EXPECT_EQ(report()["integrator"], "mlt:max_depth=6,user_paths=");
    EXPECT_FALSE(report().contains("user_path_proposed"));
    write(scene, scene_text("<string name=\"user_paths\" value=\"path.json\"/>"));
    r = render("");
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("scene.xml:2"), std::string::npos) << r.errors;
    EXPECT_NE(r.errors.find("paths.json"), std::string::npos) << r.errors;
}

}  // namespace
}  // namespace etendue::test
