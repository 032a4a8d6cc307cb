// What the program does when something fails around it: streams, signals, disks and folders.

#include <arpa/inet.h>
#include <sys/socket.h>

#include <chrono>
#include <csignal>
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
using Arguments = std::vector<std::string>;

class FailuresTest : public ::testing::Test {
protected:
    /// Through a shell, which runs the commands of `before` first; `after` has redirections.
    Program start(const Arguments& arguments, const std::string& before,
                  const std::string& after) const {
        Arguments all = {"-c", before + " exec \"$0\" \"$@\" " + after, ETENDUE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        return Program("/bin/sh", all, folder.path());
    }
    ProgramResult run(const Arguments& arguments, const std::string& before = "",
                      const std::string& after = "") const {
        return start(arguments, before, after).wait();
    }
    Arguments render(const Arguments& more = {}) const {
        Arguments all = {"render", scene, "-o", image, "--resolution", "16x16"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    static void wait(double seconds) {
        std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    }
    static void wait_for_start(const Program& program) {
        for (int i = 0; i < 3000 && !program.catches_interrupts(); ++i) wait(0.01);
    }
    size_t hidden_files() const {
        size_t count = 0;
        for (const auto& e : fs::recursive_directory_iterator(folder.path()))
            count += e.path().filename().string().starts_with(".");
        return count;
    }

    TemporaryFolder folder;
    const std::string scene = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
    const std::string image = folder.path() / "image.exr", stats = folder.path() / "stats.json";
};

TEST_F(FailuresTest, MessagesThatNobodyReadsChangeNothing) {
    ASSERT_EQ(run(render({"--spp", "2"})).status, 0);
    const std::vector<float> expected = read_image(image).data;
    for (const char* stream : {"2>/dev/full", "2>&-", "2>&- >&- <&-"}) {
        fs::remove(image);
        const ProgramResult r = run(render({"--spp", "2"}), "", stream);
        EXPECT_EQ(r.status, 0) << stream;
        EXPECT_EQ(r.signal, 0) << stream;
        EXPECT_EQ(read_image(image).data, expected) << stream;
    }
    // A pipe that is closed while the rendering lasts.
    const std::string status = folder.path() / "status";
    Program("/bin/sh",
            {"-c", "{ \"$0\" \"$@\"; echo $? >'" + status + "'; } 2>&1 | head -c 1",
             ETENDUE_PROGRAM, "render", scene, "-o", image, "--resolution", "16x16", "--time", "1"},
            folder.path())
        .wait();
    EXPECT_EQ(read_text(status), "0\n");
}

TEST_F(FailuresTest, OutputThatIsLostIsAnError) {
    ASSERT_EQ(run(render({"--spp", "1"})).status, 0);
    for (const Arguments& arguments :
         {Arguments{"list", "--json"}, Arguments{"list", "bsdf", "diffuse"},
          Arguments{"info", scene, "--json"}, Arguments{"info", scene},
          Arguments{"diff", image, image, "--json"}, Arguments{"--help"}, Arguments{"--version"},
          Arguments{"render", "--help"}})
        for (const char* stream : {">/dev/full", ">&-"}) {
            const ProgramResult r = run(arguments, "", stream);
            EXPECT_EQ(r.status, 1) << fmt::format("{} {}", fmt::join(arguments, " "), stream);
            EXPECT_TRUE(r.errors.starts_with("etendue: cannot write")) << r.errors;
        }
    // Commands that print nothing there do not need it.
    EXPECT_EQ(run(render({"--spp", "1"}), "", ">&-").status, 0);
}

TEST_F(FailuresTest, AClosedTerminalEndsARenderingWithItsImage) {
    for (const int signal : {SIGHUP, SIGTERM}) {
        fs::remove(image);
        const Program program =
            start(render({"--time", "60", "--stats", stats, "--grace", "0"}), "", "");
        wait_for_start(program);
        wait(1);
        program.send(signal);
        const ProgramResult r = program.wait();
        EXPECT_EQ(r.status, 0) << r.errors;
        EXPECT_EQ(nlohmann::json::parse(read_text(stats))["stopped_by"], "interrupted");
        EXPECT_EQ(read_image(image).width, 16);
    }
    // nohup
    const Program program = start(render({"--time", "2", "--stats", stats}), "trap '' HUP;", "");
    wait_for_start(program);
    program.send(SIGHUP);
    EXPECT_EQ(program.wait().status, 0);
    EXPECT_EQ(nlohmann::json::parse(read_text(stats))["stopped_by"], "time");
}

TEST_F(FailuresTest, CommandsWithoutResultsEndAtTheFirstSignal) {
    const Program program = start(
        {"paths", scene, "--pick", "1", "--pixel", "8,8", "--samples", "1000000000", "-o", stats},
        "", "");
    for (int i = 0; i < 3000 && !program.handles_interrupts(); ++i) wait(0.01);
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_EQ(r.status, 130);
    EXPECT_FALSE(fs::exists(stats));
}

TEST_F(FailuresTest, ProcessesThatSrunStartsWithoutMpiAreNoticedOnce) {
    for (const char* index : {"0", "1"}) {
        const ProgramResult r =
            run(render({"--spp", "1", "--quiet"}),
                fmt::format("export SLURM_STEP_NUM_TASKS=2 SLURM_PROCID={};", index));
        EXPECT_EQ(r.status, 0);
        EXPECT_EQ(r.errors.find("warning: srun has started 2 processes") != std::string::npos,
                  *index == '0')
            << r.errors;
    }
}

TEST_F(FailuresTest, FullDisksAreNamedAndKeepTheOldImage) {
    ASSERT_EQ(run(render({"--spp", "1"})).status, 0);
    const std::string before = read_text(image);
    const ProgramResult r =
        run(render({"--spp", "1", "--quiet"}), "ulimit -f 1; cd \"$(dirname \"$4\")\";", "");
    EXPECT_EQ(r.signal, 0);
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("image.exr\": File too large"), std::string::npos) << r.errors;
    EXPECT_EQ(read_text(image), before);
    EXPECT_EQ(hidden_files(), 0u);
}

/// What took hours is printed even if the file of the report cannot be written.
TEST_F(FailuresTest, VerdictsAreToldWithoutTheirFile) {
    const fs::path json = folder.path() / "report.json";
    const ProgramResult r = run({"verify", scene, "--methods", "path", "--runs", "8", "--spp", "16",
                                 "--quiet", "--resolution", "8x8", "--json", json},
                                "ulimit -f 1;", "");
    EXPECT_EQ(r.status, 1);
    EXPECT_EQ(r.output, "");
    EXPECT_NE(r.errors.find("report.json"), std::string::npos) << r.errors;
    const ProgramResult told = run({"verify", scene, "--methods", "path", "--runs", "8", "--spp",
                                    "16", "--resolution", "8x8", "--json", json},
                                   "ulimit -f 1;", "");
    EXPECT_EQ(told.status, 1);
    EXPECT_NE(told.output.find("path"), std::string::npos) << told.output;
    EXPECT_NE(told.errors.find("report.json"), std::string::npos) << told.errors;
}

/// Messages name the file and the line of the scene that asks for it.
TEST_F(FailuresTest, FilesThatCannotBeReadAreNamedWithTheirPlace) {
    const fs::path own = folder.path() / "own.xml", pbrt = folder.path() / "own.pbrt";
    for (const char* kind : {"obj", "ply", "serialized", "xml", "spd", "pbrt"})
        fs::create_symlink("/proc/self/mem", folder.path() / (std::string("unreadable.") + kind));
    for (const char* kind : {"obj", "png", "xml"})
        fs::create_directory(folder.path() / (std::string("folder.") + kind));
    const auto mesh = [](const std::string& type, const std::string& file) {
        return fmt::format("<shape type=\"{}\">\n<string name=\"filename\" value=\"{}\"/></shape>",
                           type, file);
    };
    const auto expect = [&](const fs::path& file, const std::string& text, int line,
                            const std::string& name, const char* why) {
        std::ofstream(file) << text;
        const ProgramResult r = run({"info", file});
        EXPECT_EQ(r.status, 1) << text;
        EXPECT_TRUE(r.errors.starts_with(fmt::format("etendue: {}:{}: ", file.string(), line)))
            << r.errors;
        EXPECT_NE(r.errors.find(name), std::string::npos) << r.errors;
        EXPECT_NE(r.errors.find(why), std::string::npos) << r.errors;
        EXPECT_EQ(r.errors.find("did you mean"), std::string::npos) << r.errors;
    };
    const auto expect_in_xml = [&](const std::string& text, int line, const std::string& name,
                                   const char* why) {
        expect(own,
               "<scene version=\"3.0.0\">\n<sensor type=\"perspective\"/>\n" + text + "</scene>",
               line, name, why);
    };
    const char *const error = "Input/output error", *const is_folder = "it is a folder";
    for (const char* type : {"obj", "ply", "serialized"})
        expect_in_xml(mesh(type, std::string("unreadable.") + type), 4,
                      std::string("unreadable.") + type, error);
    expect_in_xml("<include filename=\"unreadable.xml\"/>", 3, "unreadable.xml", error);
    expect_in_xml("<shape type=\"sphere\"><bsdf type=\"diffuse\">\n"
                  "<spectrum name=\"reflectance\" filename=\"unreadable.spd\"/></bsdf></shape>",
                  4, "unreadable.spd", error);
    expect(pbrt, "Camera \"perspective\"\nWorldBegin\nInclude \"unreadable.pbrt\"\n", 3,
           "unreadable.pbrt", error);
    expect(pbrt,
           "Camera \"perspective\"\nWorldBegin\n"
           "Shape \"plymesh\" \"string filename\" \"unreadable.ply\"\n",
           3, "unreadable.ply", error);
    expect_in_xml(mesh("obj", "folder.obj"), 4, "folder.obj", is_folder);
    expect_in_xml("<include filename=\"folder.xml\"/>", 3, "folder.xml", is_folder);
    expect_in_xml("<texture type=\"bitmap\" id=\"t\">\n"
                  "<string name=\"filename\" value=\"folder.png\"/></texture>\n"
                  "<shape type=\"sphere\"><bsdf type=\"diffuse\">"
                  "<ref id=\"t\" name=\"reflectance\"/></bsdf></shape>",
                  4, "folder.png", is_folder);
}

TEST_F(FailuresTest, AnImageWhoseFolderIsGoneIsWrittenElsewhere) {
    const fs::path place = folder.path() / "place", there = folder.path() / "there";
    fs::create_directory(there);
    const Program program =
        start({"render", scene, "-o", place / "image.exr", "--resolution", "16x16", "--time", "60",
               "--stats", stats, "--aov", "normal,variance", "--quiet"},
              fmt::format("cd '{}';", there.string()), "");
    wait_for_start(program);
    wait(1);
    fs::remove_all(place);
    std::ofstream(place) << "not a folder";
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_EQ(r.status, 1);
    EXPECT_EQ(r.errors.find("warning"), std::string::npos) << r.errors;
    const std::string mark = "; the image is in ";
    const size_t at = r.errors.find(mark);
    ASSERT_NE(at, std::string::npos) << r.errors;
    const std::string file =
        r.errors.substr(at + mark.size(), r.errors.find_first_of(";\n", at + 1) - at - mark.size());
    EXPECT_EQ(read_image(file).width, 16) << r.errors;
    EXPECT_GT(nlohmann::json::parse(read_text(stats))["spp"], 0);
    fs::remove(file);
}

TEST_F(FailuresTest, DevicesAndLinksAreWrittenAndStay) {
    fs::create_symlink("/dev/null", folder.path() / "null.exr");
    fs::create_symlink("real.exr", folder.path() / "link.exr");
    const ProgramResult r = run({"render", scene, "-o", folder.path() / "null.exr", "--resolution",
                                 "16x16", "--spp", "1", "--stats", "/dev/stdout"});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(nlohmann::json::parse(r.output)["spp"], 1);
    EXPECT_TRUE(fs::is_symlink(folder.path() / "null.exr"));
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    EXPECT_EQ(run({"render", scene, "-o", folder.path() / "link.exr", "--resolution", "16x16",
                   "--spp", "1", "--stats", "/dev/null"})
                  .status,
              0);
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link.exr"));
    EXPECT_EQ(read_image(folder.path() / "real.exr").width, 16);
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(FailuresTest, NamesThatAreNotUtf8LoseNothing) {
    const fs::path other = folder.path() / "sc\xe8ne.xml";
    fs::copy_file(scene, other);
    const ProgramResult r = run(
        {"render", other, "-o", image, "--resolution", "16x16", "--spp", "1", "--stats", stats});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(nlohmann::json::parse(read_text(stats))["spp"], 1);
    EXPECT_EQ(run({"info", other, "--json"}).status, 0);
    const ProgramResult v =
        run({"verify", other, "--resolution", "8x8", "--methods", "path", "--spp", "1", "--runs",
             "8", "--lengths", "1..2", "--json", stats});
    EXPECT_EQ(v.status, 0) << v.errors;
    EXPECT_EQ(nlohmann::json::parse(read_text(stats))["runs"], 8);
}

TEST_F(FailuresTest, InterruptedVerificationsKeepWhatTheyHave) {
    const Arguments arguments = {"verify", scene,       "--resolution", "8x8",      "--methods",
                                 "path",   "bdpt",      "--spp",        "4",        "--runs",
                                 "8",      "--lengths", "1..2",         "--detect", "0.01%",
                                 "--json", stats,       "--alpha",      "1e-6"};
    const Program early = start({"verify", scene, "--time", "600", "--json", stats}, "", "");
    wait_for_start(early);
    early.interrupt();
    const ProgramResult nothing = early.wait();
    EXPECT_EQ(nothing.status, 1);
    EXPECT_EQ(nothing.errors,
              "etendue: interrupted before the first comparison: nothing was written\n");
    EXPECT_FALSE(fs::exists(stats));
    // Longer each time, in case the machine is busy.
    for (double seconds = 2; seconds < 100 && !fs::exists(stats); seconds *= 3) {
        const Program program = start(arguments, "", "");
        wait_for_start(program);
        wait(seconds);
        program.interrupt();
        const auto begin = std::chrono::steady_clock::now();
        const ProgramResult r = program.wait();
        EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
        if (!fs::exists(stats)) continue;
        EXPECT_EQ(r.status, 0) << r.errors;
        EXPECT_NE(r.errors.find("warning: interrupted"), std::string::npos) << r.errors;
        EXPECT_NE(r.output.find("verdict: "), std::string::npos) << r.output;
    }
    const nlohmann::json j = nlohmann::json::parse(read_text(stats));
    EXPECT_EQ(j["interrupted"], true);
    ASSERT_GE(j["methods"].size(), 1u);
    EXPECT_EQ(j["methods"][0]["method"], "path");
    EXPECT_TRUE(j["methods"][0]["image"][0]["tested"]);
}

/// No command waits until a scene is loaded, of which nothing would be kept.
TEST_F(FailuresTest, InterruptsEndTheLoadingOfAScene) {
    const std::string large = folder.path() / "large.xml", other = folder.path() / "other.xml";
    {
        std::ofstream out(large);
        out << "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n";
        for (int i = 0; i < 200000; ++i)
            out << "<shape type=\"sphere\"><bsdf type=\"diffuse\"/></shape>\n";
        out << "</scene>\n";
    }
    const auto seconds_of = [](const auto& task) {
        const auto begin = std::chrono::steady_clock::now();
        task();
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    const double loading = seconds_of([&] { EXPECT_EQ(run({"info", large}).status, 0); });
    const std::string report = folder.path() / "report", kept = folder.path() / "kept";
    const Arguments comparison = {"--methods",    "path", "--spp",        "1",  "--report", report,
                                  "--references", kept,   "--resolution", "8x8"};
    const auto with = [](Arguments all, const Arguments& more) {
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    const Arguments commands[] = {
        {"render", large, "-o", image},
        {"verify", large},
        {"convert", large, other},
        {"info", large},
        {"studio", large, "-o", folder.path()},
        with({"compare", large}, comparison),
    };
    for (const Arguments& c : commands) {
        SCOPED_TRACE(c[0]);
        const Program program = start(c, "", "");
        const bool is_caught = c[0] == "studio" || c[0] == "compare";
        for (int i = 0;
             i < 3000 && !(is_caught ? program.catches_interrupts() : program.handles_interrupts());
             ++i)
            wait(0.01);
        wait(loading / 10);
        program.interrupt();
        ProgramResult r;
        EXPECT_LT(seconds_of([&] { r = program.wait(); }), loading / 2);
        EXPECT_EQ(r.status, 130) << r.errors;
        EXPECT_EQ(r.errors, "");
    }
    // What was compared before is written.
    const Program program = start(with({"compare", scene, large}, comparison), "", "");
    for (int i = 0; i < 3000 && !fs::exists(report + "/report.html"); ++i) wait(0.01);
    wait(loading / 10);
    program.interrupt();
    ProgramResult r;
    EXPECT_LT(seconds_of([&] { r = program.wait(); }), loading / 2);
    EXPECT_EQ(r.status, 130) << r.errors;
    EXPECT_NE(r.output.find("path"), std::string::npos) << r.output;
    EXPECT_EQ(nlohmann::json::parse(read_text(report + "/report.json"))["scenes"].size(), 1u);
}

TEST_F(FailuresTest, VerificationsOutliveAMethodThatFails) {
    const ProgramResult r = run({"verify", scene, "--resolution", "64x64", "--methods", "path",
                                 "vcm:memory=1,light_paths=65536", "--spp", "1", "--runs", "8",
                                 "--lengths", "1..2", "--json", stats});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("vcm"), std::string::npos) << r.errors;
    EXPECT_NE(r.errors.find("1 MiB"), std::string::npos) << r.errors;
    const nlohmann::json j = nlohmann::json::parse(read_text(stats));
    ASSERT_EQ(j["methods"].size(), 1u);
    EXPECT_NE(j["methods"][0]["verdict"], "deviates");
    EXPECT_EQ(j["methods"][0]["method"], "path");
    EXPECT_EQ(j["failures"].size(), 1u);
}

/// The image is larger than what the system keeps of it for the viewer.
TEST_F(FailuresTest, ViewersThatDoNotReadKeepNoRenderingWaiting) {
    const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* any = reinterpret_cast<sockaddr*>(&address);
    ASSERT_EQ(::bind(listener, any, size), 0);
    ASSERT_EQ(::listen(listener, 1), 0);
    ASSERT_EQ(::getsockname(listener, any, &size), 0);
    const ProgramResult r = run({"render", scene, "-o", image, "--resolution", "1100x1100", "-i",
                                 "path:max_depth=1", "--spp", "1", "--preview",
                                 fmt::format("tev://127.0.0.1:{}", ntohs(address.sin_port))});
    ::close(listener);
    EXPECT_EQ(r.status, 0);
    EXPECT_NE(r.errors.find("viewer does not read"), std::string::npos) << r.errors;
    EXPECT_EQ(read_image(image).width, 1100);
}

/// A small scene and a larger one.
class ComparedScenes : public FailuresTest {
protected:
    ComparedScenes() {
        const std::string text = read_text(scene);
        const auto write = [&](const std::string& file, int size) {
            std::string changed = text;
            for (const char* name : {"width", "height"}) {
                const std::string mark = fmt::format("name=\"{}\" value=\"", name);
                const size_t at = changed.find(mark) + mark.size();
                changed.replace(at, changed.find('"', at) - at, std::to_string(size));
            }
            std::ofstream(file) << changed;
        };
        write(small, 16);
        write(large, 32);
    }
    ProgramResult compare(const Arguments& more) const {
        Arguments all = {
            "compare", "--spp",        "1",        "--reference-spp",        "2", "--report",
            report,    "--references", references, "--techniques-max-depth", "0", "--quiet"};
        all.insert(all.end(), more.begin(), more.end());
        return run(all);
    }
    nlohmann::json results() const {
        return nlohmann::json::parse(read_text(report + "/report.json"));
    }

    const std::string small = folder.path() / "small.xml", large = folder.path() / "large.xml",
                      report = folder.path() / "report", references = folder.path() / "references";
};

/// How often a text has another one.
int count(const std::string& text, const std::string& part) {
    int n = 0;
    for (size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++n;
    return n;
}

TEST_F(ComparedScenes, DoNotDependOnOnesThatFailLater) {
    fs::create_directory(report);
    std::ofstream(report + "/large") << "not a folder";
    const ProgramResult r = compare({small, large, "--methods", "path"});
    EXPECT_EQ(r.status, 1);
    EXPECT_EQ(count(r.errors, "large.xml: cannot write"), 1) << r.errors;
    const nlohmann::json j = results();
    ASSERT_EQ(j["scenes"].size(), 1u);
    EXPECT_EQ(j["scenes"][0]["name"], "small");
    ASSERT_EQ(j["failures"].size(), 1u);
    EXPECT_EQ(j["failures"][0]["file"], large);
    EXPECT_TRUE(fs::exists(report + "/small/path.exr"));
    EXPECT_TRUE(fs::exists(report + "/report.html"));
}

TEST_F(ComparedScenes, KeepTheMethodsThatDoNotFail) {
    const std::string fails = "vcm:memory=1,light_paths=40000";
    const ProgramResult r = compare({large, "--methods", fails, "path"});
    EXPECT_EQ(r.status, 1);
    EXPECT_EQ(count(r.errors, fails + " failed"), 1) << r.errors;
    const nlohmann::json compared = results()["scenes"][0];
    ASSERT_EQ(compared["methods"].size(), 1u);
    EXPECT_EQ(compared["methods"][0]["name"], "path");
    EXPECT_EQ(compared["failures"].size(), 1u);
    EXPECT_EQ(compare({large, "--methods", fails}).status, 1);
}

TEST_F(ComparedScenes, AreCheckedBeforeTheFirstIsRendered) {
    const std::string missing = folder.path() / "missing.xml";
    EXPECT_EQ(compare({small, missing, "--methods", "path"}).status, 1);
    EXPECT_FALSE(fs::exists(report));
    EXPECT_FALSE(fs::exists(references));
    ASSERT_EQ(run({"render", small, "-o", image, "--spp", "1"}).status, 0);
    const ProgramResult r = run({"compare", small, large, "--methods", "path", "--spp", "1",
                                 "--report", report, "--reference", image, image});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("16 x 16"), std::string::npos) << r.errors;
    EXPECT_FALSE(fs::exists(report));
}

TEST_F(ComparedScenes, RenderDamagedReferencesAgain) {
    ASSERT_EQ(compare({small, "--methods", "path"}).status, 0);
    ASSERT_EQ(results()["scenes"][0]["reference"]["reused"], false);
    const fs::path kept = fs::directory_iterator(references)->path();
    const auto size = fs::file_size(kept);
    fs::resize_file(kept, size / 2);
    const ProgramResult r = compare({small, "--methods", "path"});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.errors.find("damaged"), std::string::npos) << r.errors;
    EXPECT_EQ(fs::file_size(kept), size);
    ASSERT_EQ(compare({small, "--methods", "path"}).status, 0);
    EXPECT_EQ(results()["scenes"][0]["reference"]["reused"], true);
}

}  // namespace
}  // namespace etendue::test
