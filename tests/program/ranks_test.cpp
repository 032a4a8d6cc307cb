// Several processes that mpirun starts render one image together.

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

class RanksTest : public ::testing::Test {
protected:
    void SetUp() override {
        if (std::string_view(ETENDUE_MPIRUN).empty())
            GTEST_SKIP() << "the program was built without ETENDUE_MPI";
        // Seconds from a signal to SIGTERM, and from there to SIGKILL.
        ::setenv("OMPI_MCA_odls_base_sigkill_timeout", "3", 1);
    }
    void TearDown() override { ::unsetenv("OMPI_MCA_odls_base_sigkill_timeout"); }

    std::string path(const std::string& name) const { return folder.path() / name; }
    Program start(const Arguments& arguments, int ranks) const {
        if (ranks == 0) return Program(ETENDUE_PROGRAM, arguments, folder.path());
        Arguments all{"--allow-run-as-root", "--oversubscribe", "--bind-to", "none", "-n",
                      std::to_string(ranks), ETENDUE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        return Program(ETENDUE_MPIRUN, all, folder.path());
    }
    ProgramResult run(const Arguments& arguments, int ranks) const {
        return start(arguments, ranks).wait();
    }
    /// Renders with a checkpoint, without mpirun if `ranks` is 0.
    Arguments render(const std::string& name, const Arguments& more) const {
        Arguments all = {"render",       scene,
                         "-o",           path(name + ".exr"),
                         "--checkpoint", path(name + ".etd"),
                         "--threads",    "1",
                         "--resolution", "40x30"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    void expect_run(const Arguments& arguments, int ranks) const {
        const ProgramResult r = run(arguments, ranks);
        ASSERT_EQ(r.status, 0) << r.errors;
    }
    nlohmann::json info(const std::string& name) const {
        const ProgramResult r = run({"info", "--json", path(name + ".etd")}, 0);
        EXPECT_EQ(r.status, 0) << r.errors;
        return nlohmann::json::parse(r.output);
    }
    void expect_same_bits(const std::string& a, const std::string& b) const {
        EXPECT_EQ(info(a)["bits"], info(b)["bits"]);
        EXPECT_TRUE(read_image(path(a + ".exr")).data == read_image(path(b + ".exr")).data);
    }
    void wait_for_file(const std::string& name) const {
        for (int i = 0; i < 3000 && !fs::exists(path(name)); ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    /// The processes of the program that mpirun has started for this test.
    std::vector<pid_t> ranks_of_job() const {
        std::vector<pid_t> found;
        for (const auto& entry : fs::directory_iterator("/proc")) {
            const std::string pid = entry.path().filename();
            if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
            const std::string line = read_text(entry.path() / "cmdline");
            if (line.starts_with(ETENDUE_PROGRAM) &&
                line.find(folder.path().string()) != std::string::npos)
                found.push_back(std::stoi(pid));
        }
        return found;
    }

    TemporaryFolder folder;
    const std::string scene = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
};

TEST_F(RanksTest, MakeTheSameBitsInAnyNumber) {
    for (const char* method : {"bdpt", "upg+bdpt:guide=on,guide_walks=500", "vcm"}) {
        SCOPED_TRACE(method);
        const Arguments how = {"-i", method, "--spp", "18", "--quiet"};
        expect_run(render("alone", how), 0);
        for (const int ranks : {1, 2, 3, 4}) {
            SCOPED_TRACE(ranks);
            expect_run(render("together", how), ranks);
            expect_same_bits("together", "alone");
        }
    }
}

TEST_F(RanksTest, EndWhereOneIsKilledAndGoOnInAnotherNumber) {
    const Arguments how = {"-i", "upg+bdpt", "--spp", "60", "--quiet"};
    expect_run(render("whole", how), 0);
    Arguments frequent = how;
    frequent.insert(frequent.end(), {"--checkpoint-every", "1e-6", "--resume", "auto"});
    const Program job = start(render("killed", frequent), 3);
    wait_for_file("killed.etd");
    const std::vector<pid_t> ranks = ranks_of_job();
    ASSERT_EQ(ranks.size(), 3u);
    kill(ranks.back(), SIGKILL);
    const ProgramResult r = job.wait();
    EXPECT_NE(r.status, 0);
    EXPECT_NE(r.errors.find("signal 9"), std::string::npos) << r.errors;
    EXPECT_TRUE(ranks_of_job().empty());
    EXPECT_LT(info("killed")["spp"], 60);
    expect_run(render("killed", frequent), 2);
    expect_same_bits("killed", "whole");
}

TEST_F(RanksTest, SignalsLeaveACheckpointAndAnImage) {
    for (const int signal : {SIGUSR1, SIGINT, SIGTERM}) {
        SCOPED_TRACE(signal);
        fs::remove(path("part.etd"));
        fs::remove(path("part.exr"));
        const Program job = start(render("part", {"-i", "bdpt", "--spp", "1000000", "--quiet",
                                                  "--checkpoint-every", "1e-6"}),
                                  2);
        wait_for_file("part.etd");
        job.send(signal);
        const int status = job.wait().status;
        // mpirun itself ends with an error after the others.
        if (signal == SIGUSR1) {
            EXPECT_EQ(status, 0);
        }
        EXPECT_TRUE(ranks_of_job().empty());
        EXPECT_TRUE(fs::exists(path("part.exr")));
        const uint64_t passes = info("part")["spp"];
        expect_run(render("whole", {"-i", "bdpt", "--spp", std::to_string(passes), "--quiet"}), 0);
        expect_same_bits("part", "whole");
    }
}

TEST_F(RanksTest, EndByTheErrorAndByTime) {
    const Arguments by_error = {"-i", "bdpt", "--error", "0.2", "--quiet"};
    expect_run(render("alone", by_error), 0);
    expect_run(render("together", by_error), 3);
    EXPECT_EQ(info("together")["spp"], info("alone")["spp"]);
    expect_same_bits("together", "alone");
    expect_run(render("timed", {"-i", "bdpt", "--time", "2", "--quiet"}), 2);
    EXPECT_NEAR(info("timed")["seconds"].get<double>(), 2, 1);
}

/// The limit of the memory for data, in bytes.
double data_limit(pid_t process) {
    const std::string text = read_text("/proc/" + std::to_string(process) + "/limits"),
                      mark = "Max data size";
    const size_t at = text.find(mark);
    return at == std::string::npos ? 0 : std::stod(text.substr(at + mark.size()));
}

TEST_F(RanksTest, DivideTheMemoryOfTheirMachine) {
    const auto limits = [&](int ranks, const Arguments& more) {
        fs::remove(path("a.etd"));
        Arguments how = {"--time", "600", "--quiet", "--checkpoint-every", "1e-6"};
        how.insert(how.end(), more.begin(), more.end());
        const Program job = start(render("a", how), ranks);
        wait_for_file("a.etd");
        std::vector<double> found;
        for (const pid_t rank : ranks_of_job()) found.push_back(data_limit(rank));
        job.send(SIGUSR1);
        job.wait();
        return found;
    };
    const std::vector<double> alone = limits(1, {}), together = limits(3, {}),
                              given = limits(2, {"--memory", "1G"});
    ASSERT_EQ(alone.size(), 1u);
    ASSERT_EQ(together.size(), 3u);
    for (const double limit : together) EXPECT_LT(limit, 0.6 * alone[0]);
    EXPECT_EQ(given, (std::vector<double>{0x1p30, 0x1p30}));
}

/// How often a text occurs.
int count(const std::string& text, const std::string& part) {
    int n = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
}

TEST_F(RanksTest, SayOnceWhatIsWrong) {
    Arguments missing = render("none", {"--spp", "1"});
    missing[1] = "missing.xml";
    ProgramResult r = run(missing, 3);
    EXPECT_NE(r.status, 0);
    EXPECT_EQ(count(r.errors, "etendue: missing.xml"), 1) << r.errors;
    r = run(render("none", {"-i", "mlt", "--spp", "1"}), 3);
    EXPECT_NE(r.status, 0);
    EXPECT_EQ(count(r.errors, "etendue: mlt cannot be rendered by several processes"), 1)
        << r.errors;
    r = run(render("done", {"--spp", "2"}), 3);
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(count(r.errors, "done.exr: 2 spp"), 1) << r.errors;
}

}  // namespace
}  // namespace etendue::test
