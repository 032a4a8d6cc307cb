// The program's command line: refused input and its messages, files that must not change, and output.

#include <algorithm>
#include <array>
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

const fs::path kBroken = fs::path(ETENDUE_SOURCE_DIR) / "tests/scenes/broken";

/// A small scene with a lamp, further objects `more`, and film parameters.
std::string furnace_text(const std::string& more = "") {
    return "<scene version=\"3.0.0\"><default name=\"size\" value=\"16\"/><integrator "
           "type=\"path\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/>"
           "<film type=\"hdrfilm\"><integer name=\"width\" value=\"$size\"/><integer "
           "name=\"height\" value=\"$size\"/></film></sensor>"
           "<shape type=\"sphere\"><point name=\"center\" value=\"0,0,4\"/></shape><emitter "
           "type=\"constant\"/>" +
           more + "</scene>";
}

class ProgramTest : public ::testing::Test {
protected:
    ProgramTest() { write(scene, furnace_text()); }

    static void write(const fs::path& file, const std::string& text) {
        std::ofstream(file) << text;
    }
    ProgramResult run(const std::vector<std::string>& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }

    /// The program must fail with one line that contains `message`, and must not change the image of an earlier run.
    void expect_refusal(std::vector<std::string> arguments, const std::string& message) const {
        SCOPED_TRACE(fmt::format("etendue {}", fmt::join(arguments, " ")));
        write(image, "an earlier picture");
        if (std::find(arguments.begin(), arguments.end(), "-o") == arguments.end())
            arguments.insert(arguments.end(), {"-o", image.string()});
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.signal, 0);
        EXPECT_TRUE(r.status == 1 || r.status == 2) << "status " << r.status;
        EXPECT_NE(r.errors.find(message), std::string::npos)
            << "it says: " << r.errors << "expected: " << message;
        EXPECT_TRUE(r.errors.starts_with("etendue: ")) << r.errors;
        EXPECT_EQ(r.errors.find("\netendue: "), std::string::npos)
            << "more than one message: " << r.errors;
        EXPECT_EQ(r.output, "");
        EXPECT_EQ(read_text(image), "an earlier picture");
    }

    TemporaryFolder folder;
    fs::path scene = folder.path() / "scene.xml", image = folder.path() / "image.exr";
};

/// The text of `<!-- expect: ... -->` in the file; empty without one.
std::string expected_message(const fs::path& file) {
    const std::string text = read_text(file), mark = "<!-- expect: ";
    const size_t begin = text.find(mark);
    if (begin == std::string::npos) return "";
    return text.substr(begin + mark.size(), text.find(" -->", begin) - begin - mark.size());
}

std::vector<fs::path> files_in(const fs::path& folder) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.is_regular_file()) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
}

/// Every `step`-th broken input.
class BrokenInputs : public ProgramTest {
protected:
    void expect_refusals(size_t step) const {
        const std::vector<fs::path> scenes = files_in(kBroken),
                                    unbuildable = files_in(kBroken / "builder"),
                                    meshes = files_in(kBroken / "meshes");
        EXPECT_GE(scenes.size(), 40u);
        EXPECT_GE(unbuildable.size(), 40u);
        for (size_t i = 0; i < scenes.size(); i += step)
            if (scenes[i].extension() == ".xml")
                expect_refusal({"render", scenes[i].string(), "--spp", "1"},
                               expected_message(scenes[i]));
        for (size_t i = 0; i < unbuildable.size(); i += step) {
            ASSERT_NE(expected_message(unbuildable[i]), "") << unbuildable[i];
            expect_refusal({"render", unbuildable[i].string(), "--spp", "1"},
                           expected_message(unbuildable[i]));
        }
        for (size_t i = 0; i < meshes.size(); i += step) {
            const std::string type = meshes[i].extension().string().substr(1);
            if (type != "obj" && type != "ply") continue;
            write(scene,
                  furnace_text("<shape type=\"" + type + "\"><string name=\"filename\" value=\"" +
                               meshes[i].string() + "\"/></shape>"));
            expect_refusal({"render", scene.string(), "--spp", "1"}, meshes[i].filename().string());
        }
    }
};
class LongBrokenInputs : public BrokenInputs {};

TEST_F(BrokenInputs, SomeAreRefused) {
    expect_refusals(8);
}
TEST_F(LongBrokenInputs, AllAreRefused) {
    expect_refusals(1);
}

TEST_F(ProgramTest, FilesOfAllReadersNeedNoCommand) {
    for (const char* name : {"a.xml", "a.xml.gz", "a.pbrt", "a.pbrt.gz", "a.gltf", "a.glb", "a.usd",
                             "a.usda", "a.usdc", "a.usdz"})
        for (const auto& arguments : {std::vector<std::string>{name, "-o", "a.png"},
                                      std::vector<std::string>{"-o", "a.png", name}}) {
            const ProgramResult r = run(arguments);
            EXPECT_EQ(r.status, 1);
            EXPECT_EQ(r.errors, fmt::format("etendue: {}: there is no such file\n", name));
        }
}

TEST_F(ProgramTest, NamesTheCommandThatIsMeant) {
    const auto refused = [&](const std::vector<std::string>& arguments,
                             const std::string& message) {
        SCOPED_TRACE(fmt::format("etendue {}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 2);
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors << message;
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
        EXPECT_TRUE(r.errors.starts_with("etendue: ")) << r.errors;
    };
    refused({}, "expected a command: render, studio");
    refused({"rendr", "a.xml"}, "there is no command \"rendr\"; did you mean \"etendue render\"?");
    refused({"Render", "a.xml"}, "did you mean \"etendue render\"?");
    refused({"integrators"}, "did you mean \"etendue list\"? (see etendue --help)");
    refused({"view", "a.exr"}, "did you mean \"etendue studio\"?");
    refused({"frobnicate"}, "there are: render, studio");
    refused({"-i", "bdpt", "render", "a.xml"}, "options follow the command: etendue render");
    refused({"render", "a.xml", "-o", "a.exr", "--samples", "4"}, "did you mean \"--spp\"?");
    refused({"render", "a.xml", "--outptu", "a.exr"}, "did you mean \"--output\"?");
    refused({"render", "a.xml", "-o", "a.exr", "--Time=3"}, "did you mean \"--time\"?");
    refused({"render", "a.xml", "-o", "a.exr", "--max_depth", "3"},
            "-i INTEGRATOR:max_depth=... (see etendue render --help)");
    refused({"render", "a.xml", "-o", "a.exr", "--width", "3"}, "did you mean \"--resolution\"?");
    refused({"render", "a.xml", "-o", "a.exr", "-x"},
            "render has no option \"-x\" (see etendue render --help)");
    refused({"compare", "a.xml", "--integrator", "path"}, "did you mean \"--methods\"?");
    refused({"render"}, "(see etendue render --help)");
    refused({"-o", "a.exr"}, "(see etendue --help)");
}

/// Options that are known, but malformed or do not go together.
TEST_F(ProgramTest, NamesTheHelpOfACommandThatIsUsedWrongly) {
    const std::string s = scene.string();
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"render", s, "--resolution", "3"},
             {"render", s, "--crop", "1,2"},
             {"render", s, "-D", "x"},
             {"render", s, "--passes", "3"},
             {"render", s, "--passes", "0:4", "--spp", "4"},
             {"render", s, "--aov", "colour"},
             {"render", s, "--resume", "auto"},
             {"render", s, "--exposure", "bright", "-o", "a.png"},
             {"render", s, "--tone", "filmic"},
             {"compare", s, "-m", "path"},
             {"compare", s, "-m", "path", "--spp", "1", "--time", "1"},
             {"compare", s, "-m", "path", "--spp", "1", "--images", "folder"},
             {"verify", s, "--detect", "2"},
             {"verify", s, "--lengths", "x"},
             {"paths", s}}) {
        SCOPED_TRACE(fmt::format("etendue {}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 2);
        EXPECT_TRUE(r.errors.ends_with(fmt::format(" (see etendue {} --help)\n", arguments[0])))
            << r.errors;
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
    }
}

TEST_F(ProgramTest, RendersASceneThatIsGivenWithoutACommand) {
    for (const bool is_first : {true, false}) {
        std::vector<std::string> arguments{"-o", image.string(), "--spp",
                                           "1",  "--resolution", "4x4"};
        arguments.insert(is_first ? arguments.begin() : arguments.end(), scene.string());
        fs::remove(image);
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 0) << r.errors;
        EXPECT_TRUE(fs::exists(image));
    }
}

TEST_F(ProgramTest, ShowsTheOptionsOfExpertsLast) {
    const std::string help = run({"render", "--help"}).output;
    const size_t experts = help.find("\nFor experts:");
    ASSERT_NE(experts, std::string::npos) << help;
    for (const char* option :
         {"--output", "--integrator", "--spp", "--time", "--resolution", "--exposure"})
        EXPECT_LT(help.find(option), experts) << option;
    EXPECT_LT(help.find("\nLong renderings:"), experts);
    for (const char* option : {"--filter-mode", "--sampler", "--watertight", "--memory"})
        EXPECT_GT(help.find(option), experts) << option;
    EXPECT_NE(run({"--help"}).output.find("\nFor experts:"), std::string::npos);
}

TEST_F(ProgramTest, KnowsUsualWords) {
    for (const auto& [usual, own] : std::vector<std::array<std::vector<std::string>, 2>>{
             {{{"help"}, {"--help"}}},
             {{{"help", "render"}, {"render", "--help"}}},
             {{{"version"}, {"--version"}}},
             {{{"list", "integrators"}, {"list", "integrator"}}},
             {{{"list", "Integrator"}, {"list", "integrator"}}},
             {{{"list", "bsdfs"}, {"list", "bsdf"}}},
             {{{"list", "materials"}, {"list", "bsdf"}}},
             {{{"list", "lights"}, {"list", "emitter"}}},
             {{{"list", "cameras"}, {"list", "sensor"}}},
             {{{"list", "media"}, {"list", "medium"}}},
             {{{"list", "AOVs"}, {"list", "aov"}}}}) {
        const ProgramResult a = run(usual), b = run(own);
        EXPECT_EQ(a.status, 0) << fmt::format("{}", fmt::join(usual, " ")) << a.errors;
        EXPECT_EQ(a.output, b.output) << fmt::format("{}", fmt::join(usual, " "));
        EXPECT_FALSE(b.output.empty());
    }
    const auto error = [&](const std::vector<std::string>& arguments) {
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 1);
        return r.errors;
    };
    EXPECT_NE(error({"list", "vcm"}).find("try \"list integrator vcm\""), std::string::npos);
    EXPECT_NE(error({"list", "integratr"}).find("did you mean \"integrator\"?"), std::string::npos);
    EXPECT_NE(error({"list", "bsdf", "difuse"}).find("did you mean \"diffuse\"?"),
              std::string::npos);
    EXPECT_NE(error({"list", "integrator", "BDPT"}).find("did you mean \"bdpt\"?"),
              std::string::npos);
}

TEST_F(ProgramTest, NamesTheIntegratorThatIsMeant) {
    const std::string s = scene.string();
    for (const auto& [given, meant] :
         std::vector<std::array<const char*, 2>>{{{"BDPT", "bdpt"}},
                                                 {{"pt", "path"}},
                                                 {{"path-tracing", "path"}},
                                                 {{"ptracer", "light"}},
                                                 {{"photonmapper", "pm"}},
                                                 {{"bidir", "bdpt"}},
                                                 {{"upg_bdpt", "upg+bdpt"}},
                                                 {{"metropolis", "mlt"}},
                                                 {{"VCM", "vcm"}}})
        expect_refusal({"render", s, "-i", given}, fmt::format("did you mean \"{}\"?", meant));
    for (const char* given : {"bdpt,max_depth=5", "bdpt max_depth=5", "bdpt;max_depth=5"})
        expect_refusal({"render", s, "-i", given}, "parameters follow a colon");
    expect_refusal({"render", s, "-i", "bdpt:maxDepth=5"}, "did you mean \"max_depth\"?");
    expect_refusal({"render", s, "-i", "bdpt:spp=5"}, "--spp");
}

TEST_F(ProgramTest, RefusesBadCommandLines) {
    const std::string s = scene.string();
    expect_refusal({"render", s, "-i", "bdtp"}, "did you mean \"bdpt\"?");
    expect_refusal({"render", s, "-i", "bdpt:max_dept=3"}, "did you mean \"max_depth\"?");
    expect_refusal({"render", s, "-i", "bdpt:max_depth=three"}, "\"three\"");
    expect_refusal({"render", s, "-i", "bdpt:max_depth=0"}, "max_depth");
    expect_refusal({"render", s, "-i", "bdpt:max_depth=3,max_depth=4"}, "twice");
    expect_refusal({"render", s, "-i", "bdpt:rr_depth"}, "rr_depth");
    expect_refusal({"render", s, "-D", "size"}, "size");
    expect_refusal({"render", s, "-D", "sise=8"}, "sise");
    expect_refusal({"render", s, "-D", "size=eight"}, "eight");
    expect_refusal({"render", s, "--crop", "0,0,99,4"}, "crop");
    expect_refusal({"render", s, "--crop", "0,0,4"}, "crop");
    expect_refusal({"render", s, "--crop", "-1,0,4,4"}, "crop");
    expect_refusal({"render", s, "--resolution", "0x8"}, "resolution");
    expect_refusal({"render", s, "--resolution", "8"}, "resolution");
    expect_refusal({"render", s, "--spp", "0"}, "spp");
    expect_refusal({"render", s, "--spp", "many"}, "spp");
    expect_refusal({"render", s, "--time", "-1"}, "time");
    expect_refusal({"render", s, "--error", "0"}, "error");
    expect_refusal({"render", s, "--time=-1"}, "must be a number above 0, but is \"-1\"");
    expect_refusal({"render", s, "--time", "nan"}, "must be a number above 0, but is \"nan\"");
    for (const char* option : {"--checkpoint-every", "--write-every"})
        for (const char* value : {"nan", "inf", "-1"})
            expect_refusal({"render", s, option, value},
                           fmt::format("{}: must be a number from 0 to", option));
    expect_refusal({"render", s, "--threads", "-2"}, "threads");
    expect_refusal({"render", s, "--sampler", "sobl"}, "sampler");
    expect_refusal({"render", s, "--aov", "albdo"}, "albdo");
    for (const char* output : {"a.pfm", "a.hdr", "a.png"})
        expect_refusal({"render", s, "--aov", "albedo", "-o", folder.path() / output},
                       "would have no layers");
    expect_refusal({"render", s, "--preview", "tef"}, "preview");
    expect_refusal({"render", s, "--colour"}, "--colour");
    expect_refusal({"render", (folder.path() / "no_such.xml").string()}, "no_such.xml");
    expect_refusal({"render", folder.path().string()}, folder.path().string());
    expect_refusal({"render"}, "SCENE");
    expect_refusal({"paint", s}, "there is no command \"paint\"");
    expect_refusal({}, "subcommand");
}

TEST_F(ProgramTest, RefusesOptionsThatHaveNoMeaning) {
    const std::string s = scene.string(), picture = folder.path() / "picture.exr";
    write_image(picture, rgb_image(2, 1, std::vector<Rgb>(2, Rgb(1))));
    const auto refuse = [&](const std::vector<std::string>& arguments, const std::string& message) {
        SCOPED_TRACE(fmt::format("etendue {}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 2);
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_EQ(r.output, "");
    };
    refuse({"verify", s, "--alpha", "nan"}, "--alpha: must be a number from 1e-09 to 0.5");
    refuse({"diff", s, s, "--ignore-above", "nan"}, "--ignore-above: must be a number");
    for (const std::vector<std::string>& command : {std::vector<std::string>{"render", s},
                                                    {"verify", s},
                                                    {"compare", s, "-m", "path", "--spp", "1"},
                                                    {"paths", s, "--pick", "1"},
                                                    {"info", s, "--choice"}}) {
        std::vector<std::string> all = command;
        all.insert(all.end(), {"--seed", "-1"});
        refuse(all, "--seed: must be an integer of at least 0, but is \"-1\"");
    }
    refuse({"verify", s, "--reference", "a.exr", "--lengths", "2..3"}, "--lengths");
    refuse({"merge", "a.etd", "-o", "m.png", "--variance"}, "would have no layers");
    for (const std::vector<std::string>& more : {std::vector<std::string>{"--crop", "0,0,1,1"},
                                                 {"-D", "foo=1"},
                                                 {"--sensor", "9"},
                                                 {"--resolution", "1x1"},
                                                 {"--lenient"}}) {
        std::vector<std::string> all{"info", picture};
        all.insert(all.end(), more.begin(), more.end());
        refuse(all, "needs a scene, but");
    }
    for (const char* more : {"bsdf", "--json"}) refuse({"list", "--mitsuba", more}, "--mitsuba");
    refuse({"tonemap", picture, folder.path() / "a.png", "--white", "3"},
           "--white applies to --operator reinhard only");
}

TEST_F(ProgramTest, RefusesOutputsThatCannotBeWritten) {
    const std::string s = scene.string();
    expect_refusal({"render", s, "--spp", "1", "-o", (folder.path() / "a.jpg").string()}, "jpg");
    expect_refusal({"render", s, "--spp", "1", "-o", (folder.path() / "a").string()},
                   "must end in");
    expect_refusal({"render", s, "--spp", "1", "-o", (scene / "a.exr").string()}, "not a folder");
    expect_refusal({"render", s, "--quiet", "--spp", "1", "-o", "/proc/a.exr"}, "/proc/a.exr");
    fs::create_directory(folder.path() / "folder.exr");
    expect_refusal(
        {"render", s, "--quiet", "--spp", "1", "-o", (folder.path() / "folder.exr").string()},
        "folder.exr");
}

TEST_F(ProgramTest, RefusesFilesThatAreNotImages) {
    const std::string s = scene.string(), none = (folder.path() / "none.exr").string();
    for (const auto& arguments : {std::vector<std::string>{"diff", s, s},
                                  {"diff", none, none},
                                  {"tonemap", s, image.string()},
                                  {"tonemap", none, image.string()}}) {
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 1) << fmt::format("{}", fmt::join(arguments, " "));
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
    }
}

TEST_F(ProgramTest, WritesImageWithLayersAndMetadataAndStatistics) {
    const fs::path stats = folder.path() / "stats.json";
    const ProgramResult r =
        run({"render", scene.string(), "-o", image.string(), "-i", "bdpt:max_depth=4", "--spp", "8",
             "--seed", "7", "-D", "size=12", "--aov", "albedo,normal,depth,variance", "--stats",
             stats.string(), "--quiet"});
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(r.output + r.errors, "");
    const Image out = read_image(image.string());
    EXPECT_EQ(out.width, 12);
    EXPECT_EQ(out.height, 12);
    const std::vector<std::string> layers = out.layers();
    for (const char* layer : {"", "albedo", "normal", "depth", "variance"})
        EXPECT_NE(std::find(layers.begin(), layers.end(), layer), layers.end())
            << "layer \"" << layer << "\"";
    // The sphere is in the centre: grey, facing the camera, at distance 3.
    const size_t middle = 12 * 6 + 6;
    EXPECT_NEAR(rgb_pixels(out, "albedo")[middle].r, 0.5f, 0.01f);
    EXPECT_NEAR(rgb_pixels(out, "depth")[middle].r, 3, 0.1f);
    EXPECT_NEAR(rgb_pixels(out, "")[middle].r, 0.5f, 0.3f);
    for (const char* key : {"scene", "integrator", "estimator", "version"})
        EXPECT_TRUE(out.attributes.count(std::string("etendue.") + key)) << key;
    for (const char* key : {"seed", "spp", "seconds"})
        EXPECT_TRUE(out.attributes.count(std::string("etendue.") + key)) << key;

    const nlohmann::json j = nlohmann::json::parse(read_text(stats));
    EXPECT_EQ(j["spp"], 8);
    EXPECT_EQ(j["seed"], 7);
    EXPECT_EQ(j["width"], 12);
    EXPECT_EQ(j["estimator"], "unbiased");
    EXPECT_EQ(j["stopped_by"], "samples");
    EXPECT_EQ(j["rejected_contributions"], 0);
    // The default filter reaches three columns and rows of the grid beside the image.
    EXPECT_EQ(j["eye_paths"], 8 * 15 * 15);
    EXPECT_EQ(j["light_paths"], 8 * 15 * 15);
    double seconds = 0;
    for (const nlohmann::json& pass : j["pass_seconds"]) {
        EXPECT_GT(pass.get<double>(), 0);
        seconds += pass.get<double>();
    }
    EXPECT_EQ(j["pass_seconds"].size(), 8u);
    EXPECT_EQ(j["pass_pairs"], std::vector<int>(8, 0));
    EXPECT_NEAR(seconds, j["seconds"].get<double>(), 1e-9);
}

TEST_F(ProgramTest, CountsThePairsOfEveryPass) {
    const fs::path cornell = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
    const fs::path stats = folder.path() / "stats.json";
    for (const char* method : {"vcm:radius=0.2", "upg+bdpt:radius=0.2"}) {
        const ProgramResult r =
            run({"render", cornell.string(), "-o", image.string(), "-i", method, "--resolution",
                 "16x16", "--spp", "4", "--stats", stats.string(), "--quiet"});
        ASSERT_EQ(r.status, 0) << r.errors;
        const nlohmann::json j = nlohmann::json::parse(read_text(stats));
        uint64_t sum = 0;
        for (const nlohmann::json& pairs : j["pass_pairs"]) sum += pairs.get<uint64_t>();
        EXPECT_EQ(j["pass_pairs"].size(), 4u);
        EXPECT_EQ(sum, j["pairs"].get<uint64_t>());
        EXPECT_GT(sum, 0u) << method;
    }
}

TEST_F(ProgramTest, WritesEveryFormat) {
    for (const char* name : {"a.exr", "a.pfm", "a.hdr", "a.png", "new/folder/a.exr"}) {
        const fs::path out = folder.path() / name;
        const ProgramResult r = run({"render", scene.string(), "-o", out.string(), "--spp", "1",
                                     "--resolution", "10x6", "--crop", "2,1,5,4"});
        ASSERT_EQ(r.status, 0) << r.errors;
        const Image written = read_image(out.string());
        EXPECT_EQ(written.width, 5) << name;
        EXPECT_EQ(written.height, 4) << name;
    }
}

/// What is written to a .png can be looked at, whatever the units of radiance are.
TEST_F(ProgramTest, MapsWhatItWritesAsPng) {
    const std::string cornell = (fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml").string();
    const auto file = [&](const char* name) { return (folder.path() / name).string(); };
    const auto render = [&](const std::string& output, std::vector<std::string> more) {
        more.insert(more.begin(), {"render", cornell, "-o", output, "--resolution", "24x24",
                                   "--spp", "4", "--quiet"});
        const ProgramResult r = run(more);
        EXPECT_EQ(r.status, 0) << r.errors;
    };
    const auto same = [](const std::string& a, const std::string& b) {
        return read_rgb(a).pixels == read_rgb(b).pixels;
    };
    render(file("a.exr"), {});
    render(file("auto.png"), {});
    ASSERT_EQ(run({"tonemap", file("a.exr"), file("tonemap.png"), "--exposure", "auto"}).status, 0);
    EXPECT_TRUE(same(file("auto.png"), file("tonemap.png")));
    render(file("plain.png"), {"--tone", "srgb", "--exposure", "0"});
    write_image(file("copy.png"), read_image(file("a.exr")));
    EXPECT_TRUE(same(file("plain.png"), file("copy.png")));
    render(file("darker.png"), {"--tone", "srgb", "--exposure", "-3"});
    EXPECT_FALSE(same(file("plain.png"), file("darker.png")));

    // The exposure follows the brightness: a thousandth of the radiance gives the same picture, but for rounding.
    RgbImage dark = read_rgb(file("a.exr"));
    for (Rgb& c : dark.pixels) c *= 1.0f / 1024;
    write_image(file("dark.exr"), rgb_image(dark.width, dark.height, dark.pixels));
    ASSERT_EQ(run({"tonemap", file("dark.exr"), file("dark.png"), "--exposure", "auto"}).status, 0);
    EXPECT_TRUE(same(file("dark.png"), file("auto.png")));
}

TEST_F(ProgramTest, DiffIgnoresTheCaseOfExtensions) {
    const std::string a = (folder.path() / "a.EXR").string(),
                      map = (folder.path() / "map.PNG").string();
    write_image(a, rgb_image(2, 1, std::vector<Rgb>{Rgb(1), Rgb(0.5f)}));
    const ProgramResult r = run({"diff", a, a, "--map", map});
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.output.find("FLIP (HDR)"), std::string::npos) << r.output;
    // False colours: no error is nearly black, but has some blue.
    const std::vector<Rgb> pixels = read_rgb(map).pixels;
    EXPECT_GT(pixels.at(0).b, pixels.at(0).r);
}

TEST_F(ProgramTest, WritesTechniqueImages) {
    const fs::path techniques = folder.path() / "techniques";
    const ProgramResult r =
        run({"render", scene.string(), "-o", image.string(), "-i", "bdpt", "--spp", "4",
             "--techniques", techniques.string(), "--techniques-max-depth", "3"});
    ASSERT_EQ(r.status, 0) << r.errors;
    // A pinhole has no t = 0.
    for (int length = 2; length <= 3; ++length)
        for (int s = 0; s <= length; ++s)
            for (const char* kind : {"weighted", "unweighted"}) {
                if (s == 3 || length == 3) continue;  // the sphere is convex: no third edge
                const fs::path file = techniques / fmt::format("length{:02}_s{:02}_t{:02}_{}.exr",
                                                               length, s, length + 1 - s, kind);
                EXPECT_TRUE(fs::exists(file)) << file;
                EXPECT_NO_THROW(read_image(file.string()));
            }
}

TEST_F(ProgramTest, EndsWithAnImageWhenInterrupted) {
    const fs::path stats = folder.path() / "stats.json";
    const Program program(
        ETENDUE_PROGRAM,
        {"render", scene.string(), "-o", image.string(), "--time", "60", "--stats", stats.string()},
        folder.path());
    // The first line of progress is printed after the first pass.
    for (int i = 0; i < 1000 && program.errors().find("spp") == std::string::npos; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    program.interrupt();
    const auto begin = std::chrono::steady_clock::now();
    const ProgramResult r = program.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(read_image(image.string()).width, 16);
    EXPECT_EQ(nlohmann::json::parse(read_text(stats))["stopped_by"], "interrupted");
}

// The renderer's own tests (tests/statistical) check that limits are met and that images do not depend on threads.
TEST_F(ProgramTest, AppliesLimits) {
    const fs::path stats = folder.path() / "stats.json";
    for (const auto& [option, value, reason] : {std::array{"--spp", "3", "samples"},
                                                {"--time", "0.1", "time"},
                                                {"--error", "0.1", "error"}}) {
        const ProgramResult r = run({"render", scene.string(), "-o", image.string(), "--stats",
                                     stats.string(), "--threads", "2", option, value});
        EXPECT_EQ(r.status, 0) << r.errors;
        EXPECT_EQ(nlohmann::json::parse(read_text(stats))["stopped_by"], reason) << option;
    }
}

TEST_F(ProgramTest, VerifiesMethods) {
    const fs::path report = folder.path() / "report.json";
    const auto with = [&](const std::vector<std::string>& more) {
        std::vector<std::string> all = {"verify", scene.string(), "-D", "size=8", "--spp", "16"};
        const auto has = [&](const char* option) {
            return std::find(more.begin(), more.end(), option) != more.end();
        };
        if (!has("--lengths") && !has("--reference")) all.insert(all.end(), {"--lengths", "1..4"});
        all.insert(all.end(), more.begin(), more.end());
        return run(all);
    };
    const ProgramResult r = with({"--json", report.string()});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.output.find("verdict: no bias was found"), std::string::npos) << r.output;
    const auto j = nlohmann::json::parse(read_text(report));
    ASSERT_EQ(j["methods"].size(), 3u);
    EXPECT_EQ(j["methods"][2]["method"], "bdpt");
    EXPECT_EQ(j["methods"][2]["verdict"], "agrees");
    EXPECT_EQ(j["methods"][2]["lengths"].size(), 4u);
    EXPECT_GT(j["tests"], 20);

    // An image of this scene, and one of a scene with another lamp.
    const auto picture = [&](const std::string& name, const std::string& more) {
        const fs::path other = folder.path() / (name + ".xml");
        write(other, furnace_text(more));
        const fs::path file = folder.path() / (name + ".exr");
        EXPECT_EQ(run({"render", other.string(), "-o", file.string(), "-D", "size=8", "-i", "path",
                       "--spp", "256", "--sampler", "independent", "--aov", "variance"})
                      .status,
                  0);
        return file.string();
    };
    const std::string same = picture("same", "");
    const std::string brighter = picture(
        "brighter", "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.1\"/></emitter>");
    EXPECT_EQ(with({"--methods", "path", "bdpt", "--reference", same}).status, 0);
    const ProgramResult rejected = with({"--methods", "path", "--reference", brighter});
    EXPECT_EQ(rejected.status, 1);
    EXPECT_EQ(rejected.errors, "etendue: claimed to be unbiased, but rejected: path\n");

    for (const auto& [arguments, message] :
         std::vector<std::pair<std::vector<std::string>, std::string>>{
             {{"--methods", "pathh"}, "did you mean \"path\"?"},
             {{"--methods", "path:max_depth=3"}, "max_depth must not be given"},
             {{"--lengths", "8..2"}, "--lengths must have the form"},
             {{"--lengths", "1..99"}, "--lengths must have the form"},
             {{"--runs", "1"}, "--runs"},
             {{"--reference", image.string()}, "image.exr"},
             {{"--reference", same, "--resolution", "9x9"}, "has 8 x 8 pixels"},
             {{"--against", "path", "--reference", same}, "--reference"},
             {{"--detect", "0.5%", "--reference", same}, "--reference"},
             {{"--detect", "0.5 percent"}, "--detect must be a share"},
             {{"--sampler", "random"}, "--sampler must be independent or sobol, but is \"random\""},
             {{"--time", "1"}, "--time and --spp exclude each other"}}) {
        const ProgramResult refused = with(arguments);
        EXPECT_TRUE(refused.status == 1 || refused.status == 2) << refused.status;
        EXPECT_NE(refused.errors.find(message), std::string::npos)
            << "it says: " << refused.errors << "expected: " << message;
    }
}

TEST_F(ProgramTest, PrintsHelpVersionListsAndInfo) {
    for (const auto& arguments : {std::vector<std::string>{"--help"},
                                  {"--version"},
                                  {"list"},
                                  {"list", "bsdf"},
                                  {"info", scene.string()},
                                  {"render", "--help"}}) {
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, 0) << r.errors;
        EXPECT_NE(r.output, "");
        EXPECT_EQ(r.errors, "");
    }
    EXPECT_EQ(nlohmann::json::parse(run({"info", scene.string(), "--json"}).output)["quadrics"], 1);
    // A scene without a sampler is rendered with 64 samples per pixel.
    EXPECT_NE(run({"info", scene.string()}).output.find(", 64 spp"), std::string::npos);
}

}  // namespace
}  // namespace etendue::test
