// Renderings that are interrupted, killed, resumed, split and merged.

#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include <fmt/format.h>

#include "checkpoint_test.h"

namespace etendue::test {
namespace {

// -- Kills.

class Killed : public CheckpointTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(Killed, ResumesWithTheSameBits) {
    // ETENDUE_KILLS: another number of kills; ETENDUE_SEED: the seed of the moments at which they happen.
    const char *wanted = std::getenv("ETENDUE_KILLS"), *seed_text = std::getenv("ETENDUE_SEED");
    const int kills = wanted ? std::atoi(wanted) : 5;
    const unsigned seed =
        seed_text ? unsigned(std::strtoul(seed_text, nullptr, 10)) : std::random_device()();
    SCOPED_TRACE(fmt::format("ETENDUE_SEED={}", seed));
    fmt::print("{}: ETENDUE_SEED={}\n", GetParam(), seed);
    const Arguments how = {
        "-i", GetParam(), "--spp", "12", "--aov", "albedo,variance", "--techniques-max-depth", "3"};
    const auto arguments = [&](const std::string& name, const Arguments& more) {
        Arguments all = render(name + ".exr", how);
        all.insert(all.end(), {"--checkpoint", path(name + ".etd"), "--techniques", path(name)});
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    const auto begin = Clock::now();
    expect_run(arguments("whole", {}));
    const double longest = seconds_since(begin);

    std::mt19937 random(seed);
    std::uniform_real_distribution<double> moment(0, longest);
    const Arguments resumed = arguments(
        "killed", {"--checkpoint-every", "1e-6", "--resume", "auto", "--write-every", "0.01"});
    int killed = 0, resumes = 0;
    // Some come too late, after the end.
    for (int i = 0; killed < kills && i < 10 * kills; ++i) {
        resumes += fs::exists(path("killed.etd"));
        const Program program = start(resumed);
        wait(moment(random));
        program.send(SIGKILL);
        const ProgramResult r = program.wait();
        killed += r.signal == SIGKILL;
        ASSERT_TRUE(r.signal == SIGKILL || r.status == 0) << r.errors;
        // What is there is whole.
        if (fs::exists(path("killed.exr"))) pixels("killed.exr");
        if (!fs::exists(path("killed.etd"))) continue;
        const auto saved = info("killed.etd");
        if (saved["spp"] != 12 || killed == kills) continue;
        // It is complete. The next kill is to meet a rendering.
        EXPECT_EQ(saved["bits"], bits("whole.etd"));
        fs::remove(path("killed.etd"));
    }
    EXPECT_EQ(killed, kills);
    resumes += fs::exists(path("killed.etd"));
    expect_run(resumed);
    fmt::print("{}: {} kills, {} resumes\n", GetParam(), killed, resumes);
    EXPECT_EQ(pixels("killed.exr"), pixels("whole.exr"));
    EXPECT_EQ(bits("killed.etd"), bits("whole.etd"));
    int techniques = 0;
    for (const auto& file : fs::directory_iterator(path("whole"))) {
        const std::string name = file.path().filename();
        EXPECT_EQ(pixels("killed/" + name), pixels("whole/" + name)) << name;
        ++techniques;
    }
    EXPECT_GT(techniques, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Methods, Killed,
    ::testing::Values("path", "path:guide=on,guide_walks=4000", "light", "bdpt", "vcm", "sppm",
                      "ppm", "upg", "upg+bdpt", "upg+bdpt:guide=on,guide_walks=4000", "pcbpt",
                      "pm:light_paths=20000,gather_rays=2",
                      "mps:mutations=4000,precision=0.2,gather_rays=2", "pssmlt:groups=4,chains=32",
                      "mmlt:groups=4,chains=48", "mlt:groups=4,chains=48",
                      "upg+pssmlt:groups=4,chains=32", "bdpt:eorr=true",
                      "mps:target=path,mutations=4000,precision=0.2,gather_rays=2"),
    [](const auto& p) {
        std::string name = p.param;
        std::replace_if(
            name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
        return name;
    });

// -- Signals.

TEST_F(CheckpointTest, SignalsLeaveACheckpointAndAnImage) {
    expect_run(
        render("whole.exr", {"-i", "upg+bdpt", "--spp", "40", "--checkpoint", path("whole.etd")}));
    int number = 0;
    for (const int signal : {SIGTERM, SIGHUP, SIGINT})
        for (const char* grace : {"0", "20"}) {
            const std::string name = std::to_string(++number);
            const Arguments arguments =
                render(name + ".exr",
                       {"-i", "upg+bdpt", "--spp", "40", "--checkpoint", path(name + ".etd"),
                        "--checkpoint-every", "1e-6", "--resume", "auto", "--grace", grace});
            const Program program = start(arguments);
            wait_for_file(name + ".etd");
            program.send(signal);
            const ProgramResult r = program.wait();
            ASSERT_EQ(r.status, 0) << r.errors;
            const uint64_t passes = info(name + ".etd")["spp"];
            EXPECT_LT(passes, 40u) << "it was finished before the signal";
            EXPECT_NE(pixels(name + ".exr"), pixels("whole.exr"));
            expect_run(arguments);
            EXPECT_EQ(pixels(name + ".exr"), pixels("whole.exr")) << signal << ", " << grace;
            EXPECT_EQ(bits(name + ".etd"), bits("whole.etd"));
        }
}

/// The third signal ends the program while it writes, which leaves the files that were there. A pipe that nobody reads
/// makes it wait.
TEST_F(CheckpointTest, TheThirdSignalEndsTheProgramAtOnce) {
    const std::string pipe = path("pipe.pfm");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    const Program program =
        start({"render", scene, "-o", pipe, "--quiet", "--resolution", "16x12", "--time", "600",
               "--checkpoint", path("a.etd"), "--checkpoint-every", "1e-6"});
    wait_for_file("a.etd");
    program.send(SIGTERM);
    // It now waits for the reader.
    wait(1);
    program.send(SIGTERM);
    wait(0.2);
    program.send(SIGTERM);
    EXPECT_EQ(program.wait().status, 130);
    EXPECT_GT(info("a.etd")["spp"], 0);
    for (const auto& e : fs::directory_iterator(folder.path()))
        EXPECT_FALSE(e.path().filename().string().starts_with(".")) << e.path();
}

/// After the time of grace there is no pass that a second signal could drop, and it loses nothing.
TEST_F(CheckpointTest, TheSecondSignalLosesNothing) {
    const std::string pipe = path("pipe.pfm");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    for (const char* grace : {"0", "1"}) {
        const std::string state = path(std::string(grace) + ".etd");
        const Program program =
            start({"render", scene, "-o", pipe, "--quiet", "--resolution", "16x12", "--time", "600",
                   "--grace", grace, "--stats", path("a.json"), "--checkpoint", state,
                   "--checkpoint-every", "1e-6"});
        wait_for_file(std::string(grace) + ".etd");
        program.send(SIGTERM);
        // It now waits for the reader.
        wait(1.5);
        program.send(SIGTERM);
        wait(0.2);
        const std::string image = read_text(pipe);
        EXPECT_EQ(program.wait().status, 0) << grace;
        EXPECT_EQ(image.size(), std::string("PF\n16 12\n-1.0\n").size() + 16 * 12 * 12) << grace;
        EXPECT_TRUE(fs::exists(path("a.json"))) << grace;
        fs::remove(path("a.json"));
    }
}

/// The program writes what it has waited for, apart from the last image and checkpoint.
TEST_F(CheckpointTest, StatisticsSayHowLongPassesHaveWaited) {
    expect_run(
        render("a.exr", {"-i", "path", "--spp", "3", "--write-every", "1e-6", "--checkpoint",
                         path("a.etd"), "--checkpoint-every", "1e-6", "--stats", path("a.json")}));
    const auto stats = nlohmann::json::parse(read_text(path("a.json")));
    EXPECT_GE(stats["checkpoints"]["written"], 1);  // Less often if they take longer than passes.
    EXPECT_GT(stats["checkpoints"]["seconds"], 0);
    EXPECT_GE(stats["images"]["written"], 1);  // They take a hundredth of the time at most.
    EXPECT_GT(stats["images"]["seconds"], 0);
    expect_run(render(
        "a.exr", {"-i", "path", "--spp", "3", "--write-every", "0", "--stats", path("a.json")}));
    EXPECT_FALSE(nlohmann::json::parse(read_text(path("a.json"))).contains("images"));
}

TEST_F(CheckpointTest, TheImageIsWrittenWhileItRenders) {
    const Program program =
        start(render("a.exr", {"-i", "path", "--time", "600", "--write-every", "0.1"}));
    wait_for_file("a.exr");
    EXPECT_EQ(pixels("a.exr").size(), 48u * 36 * 3);
    program.send(SIGKILL);
    EXPECT_EQ(program.wait().signal, SIGKILL);
    EXPECT_EQ(pixels("a.exr").size(), 48u * 36 * 3);
}

// -- Limits that are raised.

TEST_F(CheckpointTest, AFinishedRenderingGoesOn) {
    for (const char* mode : {"sample", "spread"}) {
        const Arguments how = {"-i", "bdpt", "--filter-mode", mode, "--spp"};
        const auto with = [&](const char* spp, const Arguments& more) {
            Arguments all = how;
            all.push_back(spp);
            all.insert(all.end(), more.begin(), more.end());
            return all;
        };
        expect_run(render("whole.exr", with("7", {})));
        expect_run(render("a.exr", with("3", {"--checkpoint", path("a.etd")})));
        EXPECT_EQ(info("a.etd")["spp"], 3);
        // --resume alone goes on in the same file; the number of threads does not matter.
        expect_run(render("a.exr", with("7", {"--resume", path("a.etd"), "--threads", "3",
                                              "--stats", path("a.json")})));
        EXPECT_EQ(info("a.etd")["spp"], 7);
        EXPECT_EQ(pixels("a.exr"), pixels("whole.exr"));
        const auto stats = nlohmann::json::parse(read_text(path("a.json")));
        EXPECT_EQ(stats["spp"], 7);
        EXPECT_EQ(stats["pass_seconds"].size(), 7u);
        // Nothing is left to do.
        expect_run(render("b.exr", with("5", {"--resume", path("a.etd")})));
        EXPECT_EQ(pixels("b.exr"), pixels("whole.exr"));
    }
}

TEST_F(CheckpointTest, CropsGoOn) {
    const Arguments crop = {"-i", "upg+bdpt", "--crop", "5,6,20,11", "--spp"};
    Arguments whole = crop, a = crop, b = crop;
    whole.push_back("6");
    a.insert(a.end(), {"4", "--checkpoint", path("a.etd")});
    b.insert(b.end(), {"6", "--resume", path("a.etd")});
    expect_run(render("whole.exr", whole));
    expect_run(render("a.exr", a));
    expect_run(render("a.exr", b));
    EXPECT_EQ(pixels("a.exr"), pixels("whole.exr"));
}

// -- Refusals.

TEST_F(CheckpointTest, RefusalsSayWhatDiffers) {
    expect_run(render("a.exr", {"-i", "bdpt", "--spp", "1", "--checkpoint", path("a.etd")}));
    const std::string a = path("a.etd");
    const auto expect_refused = [&](const Arguments& more, const Arguments& parts) {
        Arguments all = render("b.exr", {"--spp", "2", "--resume", a});
        for (size_t i = 0; i < more.size(); i += 2) {
            const auto given = std::find(all.begin(), all.end(), more[i]);
            if (given != all.end()) all.erase(given, given + 2);
        }
        all.insert(all.end(), more.begin(), more.end());
        const ProgramResult r = run(all);
        EXPECT_TRUE(r.status == 1 || r.status == 2) << r.status << r.errors;
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
        for (const std::string& part : parts)
            EXPECT_NE(r.errors.find(part), std::string::npos) << part << ": " << r.errors;
        EXPECT_EQ(info("a.etd")["spp"], 1);
    };
    expect_refused({"-i", "path"}, {"a.etd cannot be resumed", "\"bdpt:", "\"path:"});
    expect_refused({"-i", "bdpt:rr_depth=7"}, {"rr_depth=7"});
    expect_refused({"-i", "bdpt", "--seed", "5"}, {"seed: \"0\" there, but \"5\" here"});
    expect_refused({"-i", "bdpt", "--sampler", "independent"}, {"sobol", "independent"});
    expect_refused({"-i", "bdpt", "--resolution", "48x35"}, {"48 x 36", "48 x 35"});
    expect_refused({"-i", "bdpt", "--crop", "0,0,8,8"}, {"crop 0,0,8,8"});
    expect_refused({"-i", "bdpt", "--techniques", path("t")},
                   {"technique images", "up to 6 edges"});
    expect_refused({"-i", "bdpt", "--resume", path("missing.etd")}, {"missing.etd"});
    expect_refused({"-i", "bdpt", "--resume", ETENDUE_SOURCE_DIR "/README.md"},
                   {"README.md", "no state of a rendering"});
    expect_refused({"-i", "bdpt", "--resume", "auto"}, {"--checkpoint"});
    expect_refused({"-i", "bdpt", "--passes", "0:2"}, {"--passes and --spp"});
    expect_refused({"-i", "bdpt", "--checkpoint", path("b.exr")}, {"same file"});

    // Another scene under the same name.
    const std::string own = path("own.xml");
    std::string text = read_text(scene);
    std::ofstream(own) << text;
    expect_run({"render", own, "-o", path("c.exr"), "--spp", "1", "--quiet", "--resolution",
                "48x36", "--checkpoint", path("c.etd")});
    const size_t at = text.find("reflectance\" value=\"") + 22;
    text[at] = text[at] == '1' ? '2' : '1';
    std::ofstream(own) << text;
    const ProgramResult r = run({"render", own, "-o", path("c.exr"), "--spp", "2", "--quiet",
                                 "--resolution", "48x36", "--resume", path("c.etd")});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("scene contents"), std::string::npos) << r.errors;
}

TEST_F(CheckpointTest, NoFileIsWrittenTwice) {
    const std::string a = path("a.exr"), same = path("./a.exr");
    fs::create_symlink("a.exr", path("link"));
    for (const Arguments& more : {Arguments{"--checkpoint", same}, Arguments{"--stats", same},
                                  Arguments{"--checkpoint", path("link")},
                                  Arguments{"--checkpoint", path("s"), "--stats", path("./s")}}) {
        Arguments all = render("a.exr", {"-i", "path", "--spp", "1"});
        all.insert(all.end(), more.begin(), more.end());
        const ProgramResult r = run(all);
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find("cannot be the same file"), std::string::npos) << r.errors;
        EXPECT_FALSE(fs::exists(a));
    }
    expect_run(render("a.exr", {"-i", "path", "--spp", "1", "--checkpoint", path("a.etd")}));
    const ProgramResult r =
        run({"merge", path("a.etd"), "-o", path("m.exr"), "--stats", path("./m.exr")});
    EXPECT_EQ(r.status, 1);
    EXPECT_FALSE(fs::exists(path("m.exr")));
}

/// Standard output is written by one after the other.
TEST_F(CheckpointTest, APipeIsWrittenTwice) {
    fs::create_symlink("/dev/stdout", path("out.pfm"));
    Arguments all = {"-c", "\"$0\" \"$@\" | cat", ETENDUE_PROGRAM};
    const Arguments rest =
        render("out.pfm", {"-i", "path", "--spp", "1", "--stats", "/dev/stdout"});
    all.insert(all.end(), rest.begin(), rest.end());
    const ProgramResult r = Program("/bin/bash", all, folder.path()).wait();
    EXPECT_EQ(r.errors, "");
    ASSERT_TRUE(r.output.starts_with("PF\n48 36\n")) << r.output.substr(0, 20);
    const size_t at = r.output.find("{\n", 48 * 36 * 12);
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(nlohmann::json::parse(r.output.substr(at))["spp"], 1);
}

TEST_F(CheckpointTest, NoOutputReplacesAnInput) {
    const std::string own = path("own.xml"), a = path("a.etd"), b = path("b.etd");
    fs::copy_file(scene, own);
    expect_run(render("a.exr", {"-i", "path", "--passes", "0:1", "--checkpoint", a}));
    expect_run(render("b.exr", {"-i", "path", "--passes", "1:2", "--checkpoint", b}));
    fs::create_symlink("a.etd", path("link.etd"));
    fs::create_symlink("own.xml", path("link.exr"));
    const std::vector<std::string> inputs = {own, a, b, path("a.exr")};
    std::vector<std::string> before;
    for (const std::string& file : inputs) before.push_back(read_text(file));
    const std::string image = path("m.exr");
    for (const Arguments& arguments :
         {Arguments{"merge", a, b, "-o", a}, Arguments{"merge", b, a, "-o", a},
          Arguments{"merge", a, b, "-o", path("./b.etd")},
          Arguments{"merge", a, b, "-o", path("link.etd")},
          Arguments{"merge", path("link.etd"), b, "-o", a},
          Arguments{"merge", a, b, "-o", image, "--stats", a},
          Arguments{"merge", a, b, "-o", image, "--stats", path("link.etd")},
          Arguments{"render", own, "-o", image, "--spp", "1", "--stats", own},
          Arguments{"render", own, "-o", path("link.exr"), "--spp", "1"},
          Arguments{"render", own, "-o", image, "--spp", "1", "--checkpoint", own},
          Arguments{"verify", own, "--spp", "1", "--json", own},
          Arguments{"paths", own, "--pick", "1", "--pixel", "1,1", "-o", own},
          Arguments{"diff", path("a.exr"), path("b.exr"), "--map", path("a.exr")},
          Arguments{"tonemap", path("a.exr"), path("./a.exr")},
          Arguments{"verify", own, "--reference", path("a.exr"), "--json", path("a.exr")},
          Arguments{"verify", own, "--methods", "mlt:user_paths=" + a, "--json", a},
          Arguments{"render", own, "-o", image, "--resume", a, "--checkpoint", path("c.etd"),
                    "--stats", path("link.etd")},
          Arguments{"render", own, "-o", image, "-i", "mlt:user_paths=" + a, "--stats", a},
          Arguments{"render", own, "-o", image, "-i", "mlt:user_paths=" + a, "--checkpoint", a}}) {
        SCOPED_TRACE(fmt::format("{}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find("cannot be the same file"), std::string::npos) << r.errors;
        for (size_t i = 0; i < inputs.size(); ++i)
            EXPECT_TRUE(read_text(inputs[i]) == before[i]) << inputs[i];
        EXPECT_FALSE(fs::exists(image));
    }
}

TEST_F(CheckpointTest, NothingElseIsReplacedByACheckpoint) {
    const std::string text = path("text"), a = path("a.etd"), loop = path("loop");
    const auto arguments = [&](const std::string& file, const Arguments& more) {
        Arguments all = render("a.exr", {"-i", "path", "--spp", "1", "--checkpoint", file});
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    std::ofstream(text) << "a text";
    const ProgramResult refused = run(arguments(text, {}));
    EXPECT_EQ(refused.status, 1);
    EXPECT_NE(refused.errors.find("text is not replaced"), std::string::npos) << refused.errors;
    EXPECT_EQ(read_text(text), "a text");
    // Nor by a sum of checkpoints, which replaces an earlier sum.
    const std::string b = path("b.etd"), other = path("other.etd"), sum = path("sum.etd");
    expect_run(arguments(b, {}));
    fs::copy_file(text, other);
    const ProgramResult merged = run({"merge", b, "-o", other});
    EXPECT_EQ(merged.status, 1);
    EXPECT_NE(merged.errors.find("other.etd is not replaced"), std::string::npos) << merged.errors;
    EXPECT_EQ(read_text(other), "a text");
    for (int i = 0; i < 2; ++i) expect_run({"merge", b, "-o", sum});
    // A rendering could not go on from a sum.
    const std::string state = path("state.etd"), before = read_text(b);
    fs::copy_file(b, state);
    const ProgramResult replaced = run({"merge", b, "-o", state});
    EXPECT_EQ(replaced.status, 1);
    EXPECT_NE(replaced.errors.find("state.etd is not replaced by a sum"), std::string::npos)
        << replaced.errors;
    EXPECT_TRUE(read_text(state) == before);
    // The warning says from what a rendering could go on.
    for (const auto& [file, more, says] :
         {std::tuple{sum, Arguments{}, "it contains the sums of a rendering"},
          {state, Arguments{"--seed", "3"}, "seed: \"0\" there, but \"3\" here"}}) {
        const ProgramResult r = run(arguments(file, more));
        EXPECT_EQ(r.status, 0);
        EXPECT_NE(r.errors.find("is replaced; it could not be resumed: "), std::string::npos)
            << r.errors;
        EXPECT_NE(r.errors.find(says), std::string::npos) << r.errors;
    }
    // An earlier one is, with a warning; an empty file is none.
    std::ofstream(path("a.etd")).close();
    EXPECT_EQ(run(arguments(a, {})).errors, "");
    const ProgramResult again = run(arguments(a, {}));
    EXPECT_EQ(again.status, 0);
    EXPECT_NE(again.errors.find("--resume auto"), std::string::npos) << again.errors;
    EXPECT_EQ(run(arguments(a, {"--resume", "auto"})).errors, "");
    // Nor is one that cannot be read, by a rendering that starts anew.
    fs::create_symlink("loop", loop);
    const ProgramResult unreadable = run(arguments(loop, {"--resume", "auto"}));
    EXPECT_EQ(unreadable.status, 1);
    EXPECT_NE(unreadable.errors.find("cannot read \"" + loop), std::string::npos)
        << unreadable.errors;
}

TEST_F(CheckpointTest, DamagedFilesAreNamed) {
    expect_run(render("a.exr", {"-i", "bdpt", "--spp", "1", "--checkpoint", path("a.etd")}));
    const std::string whole = read_text(path("a.etd"));
    const auto expect_refused = [&](const std::string& contents, const std::string& part) {
        std::ofstream(path("b.etd"), std::ios::binary) << contents;
        for (const Arguments& arguments :
             {render("b.exr", {"-i", "bdpt", "--spp", "2", "--resume", path("b.etd")}),
              Arguments{"info", path("b.etd")},
              Arguments{"merge", path("b.etd"), "-o", path("b.exr")}}) {
            const ProgramResult r = run(arguments);
            EXPECT_EQ(r.status, 1);
            EXPECT_NE(r.errors.find("b.etd"), std::string::npos) << r.errors;
            EXPECT_NE(r.errors.find(part), std::string::npos) << r.errors;
        }
    };
    expect_refused(whole.substr(0, whole.size() / 2), "ends too early");
    std::string flipped = whole;
    flipped[whole.size() / 2] = char(flipped[whole.size() / 2] ^ 4);
    expect_refused(flipped, "\"film\" is damaged");
    EXPECT_FALSE(fs::exists(path("b.exr")));
}

/// A limit of memory that the first passes meet, but not a later one.
TEST_F(CheckpointTest, APassThatFailsLeavesTheCheckpointBeforeIt) {
    const auto vcm = [&](int light_paths, const char* spp, int seed) {
        return render("a.exr",
                      {"-i", fmt::format("vcm:memory=1,light_paths={}", light_paths), "--spp", spp,
                       "--seed", std::to_string(seed), "--checkpoint", path("a.etd")});
    };
    int fits = 1, fails = 1 << 16;
    while (fails - fits > 1) {
        const int light_paths = (fits + fails) / 2;
        fs::remove(path("a.etd"));
        (run(vcm(light_paths, "1", 0)).status == 0 ? fits : fails) = light_paths;
    }
    for (int seed = 0; seed < 20; ++seed) {
        fs::remove(path("a.etd"));
        const ProgramResult r = run(vcm(fits, "100", seed));
        if (r.status == 0 || !fs::exists(path("a.etd"))) continue;
        EXPECT_NE(r.errors.find("need more than 1 MiB"), std::string::npos) << r.errors;
        const std::vector<float> image = pixels("a.exr");
        const auto saved = info("a.etd");
        const int passes = saved["spp"];
        // The same without the pass that fails, and going on fails in it again.
        fs::remove(path("a.etd"));
        const std::string all = std::to_string(passes);
        expect_run(vcm(fits, all.c_str(), seed));
        EXPECT_EQ(pixels("a.exr"), image);
        EXPECT_EQ(info("a.etd")["bits"], saved["bits"]);
        Arguments on = vcm(fits, "100", seed);
        on.insert(on.end(), {"--resume", "auto"});
        EXPECT_EQ(run(on).status, 1);
        EXPECT_EQ(info("a.etd")["bits"], saved["bits"]);
        return;
    }
    FAIL() << "no pass failed with light_paths=" << fits;
}

// -- Merging.

TEST_F(CheckpointTest, RangesMakeUpOneRendering) {
    expect_run(render("whole.exr", {"-i", "path", "--spp", "12", "--checkpoint", path("w.etd"),
                                    "--techniques", path("w")}));
    for (const auto& [name, range] :
         {std::pair{"a", "0:4"}, std::pair{"b", "4:5"}, std::pair{"c", "5:12"}})
        expect_run(
            render("part.exr", {"-i", "path", "--passes", range, "--checkpoint",
                                path(std::string(name) + ".etd"), "--techniques", path("part")}));
    expect_run({"merge", path("c.etd"), path("a.etd"), path("b.etd"), "-o", path("m.exr"),
                "--techniques", path("m"), "--stats", path("m.json"), "--quiet"});
    expect_run(
        {"merge", path("a.etd"), path("b.etd"), path("c.etd"), "-o", path("n.exr"), "--quiet"});
    EXPECT_EQ(pixels("m.exr"), pixels("n.exr"));
    const std::vector<float> merged = pixels("m.exr"), whole = pixels("whole.exr");
    for (size_t i = 0; i < whole.size(); ++i) ASSERT_NEAR(merged[i], whole[i], 1e-6f * whole[i]);
    const auto stats = nlohmann::json::parse(read_text(path("m.json")));
    EXPECT_EQ(stats["spp"], 12);
    EXPECT_EQ(stats["merged"].size(), 3u);
    for (const auto& file : fs::directory_iterator(path("w")))
        EXPECT_TRUE(fs::exists(path("m") / file.path().filename()));

    // A sum is a file like its parts, but nothing goes on from it.
    expect_run({"merge", path("c.etd"), path("a.etd"), "-o", path("ac.etd"), "--quiet"});
    expect_run(
        {"merge", path("ac.etd"), path("b.etd"), "-o", path("o.exr"), "--variance", "--quiet"});
    const std::vector<float> staged = pixels("o.exr");
    EXPECT_EQ(staged.size(), 2 * whole.size());
    const ProgramResult again = run({"merge", path("ac.etd"), path("c.etd"), "-o", path("p.exr")});
    EXPECT_EQ(again.status, 1);
    EXPECT_NE(again.errors.find("share passes"), std::string::npos) << again.errors;
    const ProgramResult resumed =
        run(render("p.exr", {"-i", "path", "--spp", "20", "--resume", path("ac.etd")}));
    EXPECT_EQ(resumed.status, 1);
    EXPECT_NE(resumed.errors.find("sum of several"), std::string::npos) << resumed.errors;
}

TEST_F(CheckpointTest, MergesMoreFilesThanMayBeOpen) {
    constexpr int kFiles = 24;
    Arguments merge = {"-c",
                       "ulimit -n 20; exec \"$0\" \"$@\"",
                       ETENDUE_PROGRAM,
                       "merge",
                       "-o",
                       path("m.exr"),
                       "--techniques",
                       path("m"),
                       "--quiet"};
    for (int seed = 0; seed < kFiles; ++seed) {
        const std::string file = path(fmt::format("{}.etd", seed));
        expect_run({"render", scene, "-o", path("a.pfm"), "--quiet", "--resolution", "4x4", "-i",
                    "path", "--spp", "1", "--techniques-max-depth", "1", "--techniques", path("t"),
                    "--seed", std::to_string(seed), "--checkpoint", file});
        merge.push_back(file);
    }
    const ProgramResult r = Program("/bin/bash", merge, folder.path()).wait();
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(pixels("m.exr").size(), 4u * 4 * 3);
}

TEST_F(CheckpointTest, WhatIsMissingIsSaidBeforeAnythingIsWritten) {
    expect_run(render("a.exr", {"-i", "path", "--spp", "1", "--checkpoint", path("a.etd")}));
    const ProgramResult r =
        run({"merge", path("a.etd"), "-o", path("m.exr"), "--techniques", path("m")});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("no technique images"), std::string::npos) << r.errors;
    EXPECT_FALSE(fs::exists(path("m.exr")));
    // A folder that cannot be made, and a layer of what is no image.
    expect_run(render("b.exr", {"-i", "path", "--spp", "1", "--techniques", path("t"),
                                "--techniques-max-depth", "1", "--checkpoint", path("b.etd")}));
    const ProgramResult no_folder =
        run({"merge", path("b.etd"), "-o", path("m.exr"), "--techniques", path("b.exr/m")});
    EXPECT_EQ(no_folder.status, 1);
    EXPECT_NE(no_folder.errors.find("b.exr/m"), std::string::npos) << no_folder.errors;
    EXPECT_FALSE(fs::exists(path("m.exr")));
    const ProgramResult no_layer = run({"merge", path("b.etd"), "-o", path("m.etd"), "--variance"});
    EXPECT_EQ(no_layer.status, 2);
    EXPECT_NE(no_layer.errors.find("--variance"), std::string::npos) << no_layer.errors;
    EXPECT_FALSE(fs::exists(path("m.etd")));
}

/// A file that is called as a value of a parameter is no file of the integrator.
TEST_F(CheckpointTest, FilesOfOtherNamesMayChange) {
    const auto with = [&](const char* spp, const char* option) {
        std::ofstream(path("8")) << "when " << spp;
        Arguments all = {"-c", "cd \"$0\" && exec \"$@\"", folder.path(), ETENDUE_PROGRAM};
        const Arguments rest =
            render("a.exr", {"-i", "path:max_depth=8", "--spp", spp, option, path("a.etd")});
        all.insert(all.end(), rest.begin(), rest.end());
        const ProgramResult r = Program("/bin/bash", all, folder.path()).wait();
        EXPECT_EQ(r.status, 0) << r.errors;
    };
    with("1", "--checkpoint");
    EXPECT_EQ(info("a.etd")["conditions"]["files of the integrator"], "none");
    with("2", "--resume");
}

TEST_F(CheckpointTest, NamesThatAreNotUtf8GoOn) {
    const std::string paths = path("p\xe8.json");
    fs::copy_file(fs::path(ETENDUE_SOURCE_DIR) / "scenes/shutter-paths.json", paths);
    const auto with = [&](const char* spp, const char* option) {
        return Arguments{"render",
                         fs::path(ETENDUE_SOURCE_DIR) / "scenes/shutter.xml",
                         "-o",
                         path("a.exr"),
                         "--quiet",
                         "--resolution",
                         "8x8",
                         "-i",
                         "mlt:groups=2,chains=16,user_paths=" + paths,
                         "--spp",
                         spp,
                         option,
                         path("a.etd")};
    };
    expect_run(with("1", "--checkpoint"));
    expect_run(with("2", "--resume"));
    EXPECT_EQ(info("a.etd")["spp"], 2);
}

/// The contents of user paths matter, wherever they are.
TEST_F(CheckpointTest, UserPathsMayMove) {
    const auto with = [&](const char* folder_name, const char* passes, const char* option,
                          const char* state) {
        fs::create_directories(path(folder_name));
        const std::string paths = path(std::string(folder_name) + "/paths.json");
        fs::copy_file(fs::path(ETENDUE_SOURCE_DIR) / "scenes/shutter-paths.json", paths,
                      fs::copy_options::skip_existing);
        return Arguments{"render",
                         fs::path(ETENDUE_SOURCE_DIR) / "scenes/shutter.xml",
                         "-o",
                         path("a.exr"),
                         "--quiet",
                         "--resolution",
                         "8x8",
                         "-i",
                         "mlt:groups=2,chains=16,user_paths=" + paths,
                         "--passes",
                         passes,
                         option,
                         path(state)};
    };
    expect_run(with("one", "0:1", "--checkpoint", "a.etd"));
    expect_run(with("two", "0:2", "--resume", "a.etd"));
    EXPECT_EQ(info("a.etd")["spp"], 2);
    Arguments other = with("two", "0:2", "--checkpoint", "b.etd");
    other.insert(other.end(), {"--seed", "1"});
    expect_run(other);
    expect_run({"merge", path("a.etd"), path("b.etd"), "-o", path("sum.etd"), "--quiet"});
    std::ofstream(path("two/paths.json"), std::ios::app) << " ";
    const ProgramResult r = run(with("two", "0:3", "--resume", "a.etd"));
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("files of the integrator"), std::string::npos) << r.errors;
}

TEST_F(CheckpointTest, TheScriptForSlurmRunsWithoutIt) {
    const std::string script = fs::path(ETENDUE_SOURCE_DIR) / "examples/slurm_array.sh";
    const auto tasks = [&](const char* spp) {
        const ProgramResult r =
            Program("/bin/bash",
                    {"-c", "cd '" + folder.path().string() +
                               "' && export ETENDUE='" ETENDUE_PROGRAM "' SCENE='" + scene +
                               "' METHOD=light SPP=" + spp +
                               " && seq 0 3 | xargs -P 2 -I N env SLURM_ARRAY_TASK_ID=N bash '" +
                               script + "'"},
                    folder.path())
                .wait();
        EXPECT_EQ(r.status, 0) << r.errors;
    };
    // The second time, the tasks go on.
    tasks("1");
    tasks("2");
    Arguments merge = {"merge", "-o", path("image.exr"), "--quiet", "--stats", path("s.json")};
    for (const char* task : {"3", "1", "0", "2"})
        merge.push_back(path(std::string("task-") + task + ".etd"));
    expect_run(merge);
    EXPECT_EQ(nlohmann::json::parse(read_text(path("s.json")))["spp"], 8);
}

/// The signal before the end of a task's time may come when its rendering has ended.
TEST_F(CheckpointTest, TheScriptForSlurmTakesLateSignals) {
    const auto write_program = [&](const char* name, const char* text) {
        std::ofstream(path(name)) << "#!/bin/bash\n" << text;
        fs::permissions(path(name), fs::perms::owner_all);
    };
    // Each sends the signal to the script that calls it; the rendering then waits to be stopped.
    write_program(
        "etendue",
        "trap 'exit 0' TERM; echo \"$@\"; kill -USR1 $PPID; while :; do sleep 0.01; done");
    write_program("scontrol", "echo \"$@\"; kill -USR1 $PPID; sleep 0.1");
    const ProgramResult r =
        Program("/bin/bash",
                {"-c", fmt::format("cd '{0}' && PATH='{0}':$PATH SCENE=a METHOD=b SPP=1 "
                                   "SLURM_ARRAY_TASK_ID=7 SLURM_JOB_ID=12 GRACE=60 bash "
                                   "'" ETENDUE_SOURCE_DIR "/examples/slurm_array.sh'",
                                   folder.path().string())},
                folder.path())
            .wait();
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.output.find("--grace 60"), std::string::npos) << r.output;
    EXPECT_NE(r.output.find("requeue 12"), std::string::npos) << r.output;
}

TEST_F(CheckpointTest, PassesMustBeARange) {
    for (const char* range :
         {"3", "3:", ":3", "3:3", "4:3", "a:b", "-1:3", "1:2:3", "0:5000000000"}) {
        const ProgramResult r = run(render("a.exr", {"--passes", range}));
        EXPECT_EQ(r.status, std::string(range) == "0:5000000000" ? 1 : 2) << range;
        EXPECT_FALSE(fs::exists(path("a.exr"))) << range;
    }
}

}  // namespace
}  // namespace etendue::test
