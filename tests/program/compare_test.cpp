// The command line of `etendue compare`: its output, and refused input.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class CompareTest : public ::testing::Test {
protected:
    ProgramResult run(std::vector<std::string> arguments) const {
        arguments.insert(arguments.begin(), "compare");
        arguments.insert(arguments.end(), {"--report", report.string(), "--references",
                                           (folder.path() / "references").string(), "--quiet"});
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    void expect_refusal(const std::vector<std::string>& arguments,
                        const std::string& message) const {
        SCOPED_TRACE(fmt::format("etendue compare {}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_TRUE(r.status == 1 || r.status == 2) << "status " << r.status;
        EXPECT_TRUE(r.errors.starts_with("etendue: ")) << r.errors;
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_FALSE(fs::exists(report));
    }

    const std::string scene = (fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml").string();
    TemporaryFolder folder;
    fs::path report = folder.path() / "report";
};

TEST_F(CompareTest, ComparesInnerPathsOnly) {
    const ProgramResult r =
        run({scene, "--methods", "bdpt", "pcbpt:direct=next_event", "--spp", "4", "--reference-spp",
             "64", "--resolution", "32x24", "--paths", "inner", "--techniques-max-depth", "2"});
    ASSERT_EQ(r.status, 0) << r.errors;
    const nlohmann::json j = nlohmann::json::parse(read_text(report / "report.json"));
    EXPECT_EQ(j["settings"]["paths"], "inner");
    for (const nlohmann::json& m : j["scenes"][0]["methods"])
        EXPECT_NEAR(m["summary"]["mean_ratio"]["value"].get<double>(), 1, 0.2);
    EXPECT_TRUE(fs::exists(report / "cornell/bdpt-techniques/length02_s01_t02.png"));
    EXPECT_FALSE(fs::exists(report / "cornell/bdpt-techniques/length02_s02_t01.png"));
}

TEST_F(CompareTest, RefusesInnerPathsWithDifferentWeights) {
    expect_refusal(
        {scene, "--methods", "bdpt", "pcbpt:direct=both", "--spp", "1", "--paths", "inner"},
        "\"pcbpt:direct=both\" weights its techniques differently than the reference \"bdpt");
    expect_refusal({scene, "--methods", "bdpt", "--spp", "1", "--paths", "outer"}, "outer");
}

TEST_F(CompareTest, ComparesPathsOfGivenLengths) {
    const auto mean = [&](const std::string& lengths) {
        const ProgramResult r =
            run({scene, "--methods", "bdpt", "--spp", "64", "--reference-spp", "256",
                 "--resolution", "32x24", "--lengths", lengths, "--techniques-max-depth", "0"});
        EXPECT_EQ(r.status, 0) << r.errors;
        const nlohmann::json j = nlohmann::json::parse(read_text(report / "report.json"));
        const nlohmann::json& m = j["scenes"][0]["methods"][0];
        EXPECT_NEAR(m["summary"]["mean_ratio"]["value"].get<double>(), 1, 0.1) << lengths;
        return m["runs"][0]["mean_luminance"].get<double>();
    };
    const double all = mean("1.."), shortest = mean("1..2"), rest = mean("3..");
    EXPECT_GT(shortest, rest);
    EXPECT_NEAR(shortest + rest, all, 0.05 * all);
    fs::remove_all(report);
    for (const char* lengths : {"3", "0..2", "3..2", "..", "2..x"})
        expect_refusal({scene, "--methods", "bdpt", "--spp", "1", "--lengths", lengths},
                       "--lengths must have the form");
}

TEST_F(CompareTest, WritesAReport) {
    const ProgramResult r =
        run({scene, "--methods", "path", "bdpt:max_depth=-1", "--spp", "8", "--reference-spp", "64",
             "--resolution", "32x24", "--runs", "2", "--techniques-max-depth", "3"});
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(r.output + r.errors, "");
    const nlohmann::json j = nlohmann::json::parse(read_text(report / "report.json"));
    ASSERT_EQ(j["scenes"].size(), 1u);
    const nlohmann::json& s = j["scenes"][0];
    EXPECT_EQ(s["name"], "cornell");
    EXPECT_EQ(s["width"], 32);
    EXPECT_EQ(s["height"], 24);
    EXPECT_EQ(s["reference"]["spp"], 64);
    EXPECT_EQ(s["reference"]["variance_known"], true);
    EXPECT_GT(s["reference"]["rel_mse"].get<double>(), 0);
    ASSERT_EQ(s["methods"].size(), 2u);
    for (const nlohmann::json& m : s["methods"]) {
        SCOPED_TRACE(m["name"].get<std::string>());
        ASSERT_EQ(m["runs"].size(), 2u);
        EXPECT_EQ(m["runs"][0]["spp"], 8);
        EXPECT_EQ(m["runs"][1]["seed"], 1);
        EXPECT_EQ(m["runs"][0]["checkpoints"].size(), 4u);  // 1, 2, 4 and 8 samples
        EXPECT_EQ(m["runs"][0]["eye_paths"], 8 * 32 * 24);
        EXPECT_NEAR(m["summary"]["mean_ratio"]["value"].get<double>(), 1, 0.1);
        EXPECT_GT(m["summary"]["rel_mse"].get<double>(), 0);
        EXPECT_LT(m["summary"]["rel_mse"].get<double>(), 0.5);
        EXPECT_GT(m["flip"].get<double>(), 0);
        EXPECT_LT(m["flip"].get<double>(), 1);
        const auto& first = m["runs"][0]["checkpoints"][0]["errors"]["rel_mse"];
        EXPECT_GT(first.get<double>(), m["runs"][0]["errors"]["rel_mse"].get<double>());
    }
    EXPECT_EQ(s["methods"][0]["summary"]["efficiency"]["value"], 1);
    for (const char* file :
         {"reference.exr", "path.exr", "path.png", "path-flip.png", "path-relse.png",
          "bdpt_max_depth=-1.png", "convergence-rmse.svg", "convergence-rel_mse.svg",
          "bdpt_max_depth=-1-techniques/length02_s01_t02.png"})
        EXPECT_TRUE(fs::exists(report / "cornell" / file)) << file;
    EXPECT_EQ(read_image((report / "cornell/path.exr").string()).width, 32);

    const std::string page = read_text(report / "report.html");
    EXPECT_NE(page.find("data:image/png;base64,"), std::string::npos);
    EXPECT_EQ(page.find("{{"), std::string::npos) << "a placeholder is left";
    for (const char* outside : {"src=\"http", "href=\"http", "@import", "fetch("})
        EXPECT_EQ(page.find(outside), std::string::npos) << outside;
}

TEST_F(CompareTest, ReadsReferencesForSeveralScenes) {
    const fs::path image = folder.path() / "image.exr";
    ASSERT_EQ(Program(ETENDUE_PROGRAM,
                      {"render", scene, "-o", image.string(), "--spp", "4", "--resolution", "16x16",
                       "--aov", "variance", "--quiet"},
                      folder.path())
                  .wait()
                  .status,
              0);
    const ProgramResult r = run({scene, scene, "--methods", "path", "--time", "0.2", "--resolution",
                                 "16x16", "--reference", image.string(), image.string()});
    ASSERT_EQ(r.status, 0) << r.errors;
    const nlohmann::json j = nlohmann::json::parse(read_text(report / "report.json"));
    ASSERT_EQ(j["scenes"].size(), 2u);
    EXPECT_EQ(j["scenes"][0]["name"], "cornell");
    EXPECT_EQ(j["scenes"][1]["name"], "cornell-2");
    EXPECT_EQ(j["scenes"][0]["reference"]["variance_known"], true);
    const double seconds = j["scenes"][0]["methods"][0]["summary"]["seconds"];
    EXPECT_NEAR(seconds, 0.2, 0.15);
}

/// They have layers that the images of reports have not.
TEST_F(CompareTest, ReferencesInTheReportAreNotReplaced) {
    fs::create_directories(report / "cornell");
    for (const char* name : {"reference.exr", "path.exr"}) {
        const std::string image = report / "cornell" / name;
        ASSERT_EQ(Program(ETENDUE_PROGRAM,
                          {"render", scene, "-o", image, "--spp", "4", "--resolution", "16x16",
                           "--aov", "variance", "--quiet"},
                          folder.path())
                      .wait()
                      .status,
                  0);
        const std::string before = read_text(image);
        const ProgramResult r = run({scene, "--methods", "path", "--spp", "2", "--resolution",
                                     "16x16", "--reference", image, "--techniques-max-depth", "0"});
        ASSERT_EQ(r.status, 0) << r.errors;
        EXPECT_TRUE(read_text(image) == before) << name;
        fs::remove(image);
    }
    EXPECT_TRUE(fs::exists(report / "cornell/path-2.exr"));
    EXPECT_TRUE(fs::exists(report / "cornell/reference.exr"));
}

TEST_F(CompareTest, RefusesBadCommandLines) {
    const std::string none = (folder.path() / "none.exr").string();
    expect_refusal({scene, "--methods", "path", "bdtp", "--spp", "1"}, "did you mean \"bdpt\"?");
    expect_refusal({scene, "--methods", "path:max_dept=3", "--spp", "1"},
                   "did you mean \"max_depth\"?");
    expect_refusal({scene, "--methods", "path", "path", "--spp", "1"}, "twice");
    expect_refusal({scene, "--methods", "path"}, "--time or --spp");
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--time", "1"}, "exclude");
    expect_refusal({scene, "--spp", "1"}, "--methods");
    expect_refusal({"--methods", "path", "--spp", "1"}, "SCENE");
    expect_refusal({scene, "--methods", "path", "--spp", "0"}, "spp");
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--runs", "0"}, "runs");
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--reference", none}, "none.exr");
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--reference", none, none},
                   "one image per scene");
    expect_refusal(
        {scene, "--methods", "path", "--spp", "1", "--reference", none, "--reference-time", "1"},
        "--reference-time");
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--reference-method", "bdtp"},
                   "did you mean \"bdpt\"?");
    expect_refusal({scene + ".no", "--methods", "path", "--spp", "1"}, "no such file");
}

TEST_F(CompareTest, RefusesAReferenceOfAnotherSize) {
    const fs::path image = folder.path() / "image.exr";
    write_image(image.string(), rgb_image(8, 4, std::vector<Rgb>(32, Rgb(1))));
    expect_refusal({scene, "--methods", "path", "--spp", "1", "--resolution", "16x16",
                    "--reference", image.string()},
                   "8 x 4");
}

}  // namespace
}  // namespace etendue::test
