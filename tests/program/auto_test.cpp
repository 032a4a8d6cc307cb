// `auto` in the program: what it says, and that its images are those of the method that it has chosen.

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

class AutoTest : public ::testing::Test {
protected:
    std::string path(const std::string& name) const { return folder.path() / name; }
    ProgramResult run(const Arguments& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    /// With a checkpoint, and statistics. Each pass has the same seconds by the budget of the choice.
    Arguments rendering(const std::string& name, const Arguments& more) const {
        Arguments all{"render",       scene,
                      "-o",           path(name + ".exr"),
                      "--stats",      path(name + ".json"),
                      "--checkpoint", path(name + ".etd"),
                      "--resolution", "64x48"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    std::string render(const std::string& name, const Arguments& more) const {
        const ProgramResult r = run(rendering(name, more));
        EXPECT_EQ(r.status, 0) << r.errors;
        return r.errors;
    }
    nlohmann::json report(const std::string& name) const {
        return nlohmann::json::parse(read_text(path(name + ".json")));
    }
    std::string bits(const std::string& name) const {
        const ProgramResult r = run({"info", "--json", path(name + ".etd")});
        EXPECT_EQ(r.status, 0) << r.errors;
        return nlohmann::json::parse(r.output)["bits"].dump();
    }
    void expect_same(const std::string& a, const std::string& b) const {
        EXPECT_TRUE(read_image(path(a + ".exr")).data == read_image(path(b + ".exr")).data);
        EXPECT_EQ(bits(a), bits(b));
    }

    TemporaryFolder folder;
    std::string scene = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
};

/// Enough for pilots of several methods.
const Arguments kHow{"-i", "auto:chains=false", "--spp", "192"};

Arguments with(Arguments how, const Arguments& more) {
    how.insert(how.end(), more.begin(), more.end());
    return how;
}

TEST_F(AutoTest, TellsWhatItHasChosenAndTheTextGivesTheSameBits) {
    const std::string log = render("auto", with(kHow, {"--threads", "1"}));
    const nlohmann::json j = report("auto");
    const std::string chosen = j["integrator"];
    EXPECT_NE(log.find("auto: " + chosen + ", predicted to need "), std::string::npos) << log;
    EXPECT_EQ(j["auto"]["chosen"], chosen);
    EXPECT_EQ(j["auto"]["candidates"][0]["method"], chosen);
    EXPECT_GE(j["auto"]["candidates"].size(), 2u);
    EXPECT_GE(j["seconds"].get<double>(), j["auto"]["seconds"].get<double>());
    render("threads", with(kHow, {"--threads", "2"}));
    expect_same("threads", "auto");
    render("given", {"-i", chosen, "--spp", "192"});
    EXPECT_FALSE(report("given").contains("auto"));
    expect_same("given", "auto");
}

TEST_F(AutoTest, GoesOnWithTheMethodOfTheCheckpoint) {
    render("whole", kHow);
    // A limit of one pass would choose nothing: bdpt, without pilots.
    render("part", kHow);
    const std::string chosen = report("part")["integrator"];
    const std::string log =
        render("part", {"-i", "auto:chains=false", "--spp", "200", "--resume", "auto"});
    EXPECT_EQ(report("part")["integrator"], chosen);
    EXPECT_EQ(report("part")["auto"]["budget"], report("whole")["auto"]["budget"]);
    EXPECT_NE(log.find("resumed after 192 passes"), std::string::npos) << log;
    render("whole", {"-i", chosen, "--spp", "200"});
    expect_same("part", "whole");
    // The checkpoint was chosen by other parameters.
    const ProgramResult r =
        run(rendering("part", {"-i", "auto:consistent=true", "--spp", "300", "--resume", "auto"}));
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("chains=false"), std::string::npos) << r.errors;
}

TEST_F(AutoTest, RendersScenesThatNameNoIntegrator) {
    const std::string file = path("scene.xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/></scene>)";
    const ProgramResult r =
        run({"render", file, "-o", path("a.exr"), "--resolution", "8x6", "--spp", "2"});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.errors.find("auto: bdpt, without pilots"), std::string::npos) << r.errors;
}

/// The choice without a rendering: as text, and as JSON the same as in the statistics of a rendering.
TEST_F(AutoTest, InfoShowsTheChoice) {
    const auto info = [&](const Arguments& more) {
        Arguments all{"info", scene, "--resolution", "64x48", "--choice"};
        all.insert(all.end(), more.begin(), more.end());
        return run(all);
    };
    render("a", with(kHow, {"--seed", "3"}));
    auto rendered = report("a")["auto"];
    const ProgramResult r = info(with(kHow, {"--seed", "3", "--json", "--threads", "1"}));
    ASSERT_EQ(r.status, 0) << r.errors;
    auto shown = nlohmann::json::parse(r.output)["choice"];
    for (auto* of : {&rendered, &shown}) of->erase("seconds");
    EXPECT_EQ(shown, rendered);

    const ProgramResult text = info(with(kHow, {"--seed", "3"}));
    EXPECT_EQ(text.status, 0) << text.errors;
    for (const auto& c : shown["candidates"])
        EXPECT_NE(text.output.find("    " + c["method"].get<std::string>() + " "),
                  std::string::npos)
            << text.output;
    // Where pilots would take too long, too.
    EXPECT_NE(info({"--spp", "1"}).output.find("no pilot"), std::string::npos);

    // Of a guide.
    const ProgramResult guide = info({"-i", "path:guide=auto,guide_walks=20000", "--spp", "3000"});
    EXPECT_EQ(guide.status, 0) << guide.errors;
    EXPECT_NE(guide.output.find("    path:guide=on "), std::string::npos) << guide.output;

    const auto expect_refusal = [&](const ProgramResult& refused, const std::string& message) {
        EXPECT_EQ(refused.status, 2);
        EXPECT_EQ(refused.output, "");
        EXPECT_NE(refused.errors.find(message), std::string::npos) << refused.errors;
    };
    expect_refusal(info({"-i", "bdpt"}), "-i must be auto");
    expect_refusal(info({"--guide"}), "--guide");
    expect_refusal(run({"info", scene, "--seed", "1"}), "--seed requires --guide or --choice");
    expect_refusal(run({"info", scene, "--time", "1"}), "--choice");
}

/// As while a scene is loaded: there is nothing to write yet.
TEST_F(AutoTest, InterruptsOfPilotsEndTheProgram) {
    const Program program(ETENDUE_PROGRAM,
                          {"render", scene, "-o", path("a.exr"), "-i", "auto", "--time", "100000"},
                          folder.path());
    std::this_thread::sleep_for(std::chrono::seconds(1));
    program.interrupt();
    const auto begin = std::chrono::steady_clock::now();
    const ProgramResult r = program.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
    EXPECT_EQ(r.status, 130) << r.errors;
    EXPECT_FALSE(fs::exists(path("a.exr")));
}

TEST_F(AutoTest, PartsCanBeMergedAndPartsOfOtherMethodsCannot) {
    for (const auto& [name, passes] : {std::pair{"a", "0:96"}, {"b", "96:192"}})
        render(name, {"-i", "auto:chains=false", "--passes", passes});
    EXPECT_EQ(report("a")["integrator"], report("b")["integrator"]);
    const ProgramResult sum = run({"merge", "-o", path("sum.exr"), path("a.etd"), path("b.etd")});
    EXPECT_EQ(sum.status, 0) << sum.errors;
    render("other", {"-i", "light", "--passes", "192:193"});
    const ProgramResult r = run({"merge", "-o", path("sum.exr"), path("a.etd"), path("other.etd")});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("integrator"), std::string::npos) << r.errors;
}

TEST_F(AutoTest, ProcessesThatRenderTogetherChooseTheSame) {
    if (std::string_view(ETENDUE_MPIRUN).empty())
        GTEST_SKIP() << "the program was built without ETENDUE_MPI";
    render("alone", with(kHow, {"--threads", "1"}));
    const auto together = [&](const std::string& name, const Arguments& how) {
        Arguments all{"--allow-run-as-root", "--oversubscribe", "--bind-to", "none", "-n", "2",
                      ETENDUE_PROGRAM};
        const Arguments own = rendering(name, with(how, {"--threads", "1"}));
        all.insert(all.end(), own.begin(), own.end());
        const ProgramResult r = Program(ETENDUE_MPIRUN, all, folder.path()).wait();
        EXPECT_EQ(r.status, 0) << r.errors;
        return r.errors;
    };
    const std::string log = together("together", kHow);
    expect_same("together", "alone");
    EXPECT_EQ(log.find("auto: "), log.rfind("auto: ")) << log;
    // Chains cannot be shared.
    together("chains", {"-i", "auto", "--spp", "192"});
    expect_same("chains", "alone");
}

}  // namespace
}  // namespace etendue::test
