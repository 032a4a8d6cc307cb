// Every command that renders says at its end what the image lacks.

#include <filesystem>
#include <fstream>
#include <regex>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

/// A lamp so bright that contributions overflow.
class WarningsTest : public ::testing::Test {
protected:
    WarningsTest() {
        const std::string text = read_text(fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml");
        const std::regex lamp("(name=\"radiance\" value=)\"[^\"]*\"");
        std::ofstream(scene) << std::regex_replace(text, lamp, "$1\"3e38\"");
    }
    ProgramResult run(std::vector<std::string> arguments) const {
        arguments.insert(arguments.end(), {"--resolution", "16x16", "--quiet"});
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    nlohmann::json report() const { return nlohmann::json::parse(read_text(json)); }
    /// `lines` lines that begin so.
    static void expect_warnings(const std::string& errors, const std::string& begin, int lines) {
        const std::regex line("warning: " + begin + "[0-9]+ contributions were not finite");
        EXPECT_EQ(std::distance(std::sregex_iterator(errors.begin(), errors.end(), line), {}),
                  lines)
            << errors;
    }

    TemporaryFolder folder;
    const std::string scene = folder.path() / "bright.xml", json = folder.path() / "report.json";
};

TEST_F(WarningsTest, OfRender) {
    const ProgramResult r = run({"render", scene, "-o", folder.path() / "image.exr", "-i", "bdpt",
                                 "--spp", "2", "--stats", json});
    EXPECT_EQ(r.status, 0) << r.errors;
    expect_warnings(r.errors, "", 1);
    EXPECT_EQ(report()["warnings"].size(), 1u);
    EXPECT_GT(report()["rejected_contributions"], 0);
}

TEST_F(WarningsTest, OfMerge) {
    const std::string saved = folder.path() / "a.etd";
    run({"render", scene, "-o", folder.path() / "image.exr", "-i", "bdpt", "--spp", "2",
         "--checkpoint", saved});
    const ProgramResult r =
        Program(ETENDUE_PROGRAM, {"merge", saved, "-o", folder.path() / "sum.exr", "--quiet"},
                folder.path())
            .wait();
    EXPECT_EQ(r.status, 0) << r.errors;
    expect_warnings(r.errors, "", 1);
}

TEST_F(WarningsTest, OfVerify) {
    const ProgramResult r = run({"verify", scene, "--methods", "bdpt", "--against", "path", "bdpt",
                                 "--spp", "2", "--lengths", "1..3", "--json", json});
    expect_warnings(r.errors, "bdpt:max_depth=3: ", 1);
    expect_warnings(r.errors, "bdpt:max_depth=3,roulette=0: ", 1);
    expect_warnings(r.errors, "bdpt:max_depth=3,rr_depth=4: ", 1);
    EXPECT_EQ(report()["warnings"].size(), 3u);
    EXPECT_GT(report()["methods"][0]["rejected_contributions"], 0);
    EXPECT_EQ(report()["methods"][0]["runaways"], 0);
}

TEST_F(WarningsTest, OfCompareAlsoWhereTheReferenceIsKept) {
    for (const bool is_kept : {false, true}) {
        const ProgramResult r =
            run({"compare", scene, "--methods", "path", "bdpt", "--spp", "2", "--reference-spp",
                 "4", "--report", folder.path(), "--references", folder.path() / "references"});
        EXPECT_EQ(r.status, 0) << r.errors;
        expect_warnings(r.errors, ".*bright.xml: reference: ", 1);
        expect_warnings(r.errors, ".*bright.xml: bdpt: ", 1);
        expect_warnings(r.errors, ".*", 2);
        const nlohmann::json j = report()["scenes"][0];
        EXPECT_EQ(j["reference"]["reused"], is_kept);
        EXPECT_EQ(j["reference"]["warnings"].size(), 1u);
        EXPECT_TRUE(j["methods"][0]["warnings"].empty());
        EXPECT_EQ(j["methods"][1]["warnings"].size(), 1u);
    }
}

}  // namespace
}  // namespace etendue::test
