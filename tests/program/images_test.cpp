// Images of other programs on the command line: `etendue verify --images` and `etendue compare --images`.

#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;
using Change = std::function<Rgb(Rgb)>;

class ImagesTest : public ::testing::Test {
protected:
    ProgramResult run(const Arguments& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    std::string path(const std::string& name) const { return (folder.path() / name).string(); }
    RgbImage rendered(int seed, int spp) const {
        const ProgramResult r =
            run({"render", scene, "--resolution", "12x12", "-i", "path:max_depth=4", "--spp",
                 std::to_string(spp), "--sampler", "independent", "--seed", std::to_string(seed),
                 "-o", path("rendered.exr"), "--quiet"});
        EXPECT_EQ(r.status, 0) << r.errors;
        return read_rgb(path("rendered.exr"));
    }
    void write(const std::string& name, RgbImage image, const Change& change = {}) const {
        fs::create_directories((folder.path() / name).parent_path());
        if (change)
            for (Rgb& c : image.pixels) c = change(c);
        write_image(path(name), rgb_image(image.width, image.height, image.pixels));
    }
    /// A folder of images with consecutive seeds.
    void render_set(const std::string& name, int first_seed, int count,
                    const Change& change = {}) const {
        for (int i = 0; i < count; ++i)
            write(fmt::format("{}/{}.exr", name, i), rendered(first_seed + i, 256), change);
    }
    void expect_refusal(const Arguments& arguments, const std::string& message) const {
        SCOPED_TRACE(fmt::format("etendue {}", fmt::join(arguments, " ")));
        const ProgramResult r = run(arguments);
        EXPECT_TRUE(r.status == 1 || r.status == 2) << "status " << r.status;
        EXPECT_TRUE(r.errors.starts_with("etendue: ")) << r.errors;
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
    }

    const std::string scene = (fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml").string();
    TemporaryFolder folder;
};

TEST_F(ImagesTest, AreTestedForEqualExpectations) {
    render_set("a", 1, 8);
    render_set("b", 101, 8);
    const ProgramResult equal = run({"verify", "--images", path("a"), "--against", path("b"),
                                     "--tiles", "2", "--json", path("equal.json")});
    EXPECT_EQ(equal.status, 0) << equal.errors;
    EXPECT_NE(equal.output.find("no difference of the expectations was found"), std::string::npos)
        << equal.output;
    EXPECT_NE(equal.output.find("would have been found with 90 % probability"), std::string::npos)
        << equal.output;
    const nlohmann::json j = nlohmann::json::parse(read_text(path("equal.json")));
    EXPECT_EQ(j["images"], 8);
    EXPECT_EQ(j["methods"][0]["verdict"], "agrees");
    EXPECT_EQ(j["methods"][0]["tiles"].size(), 12u);

    // A program that clamps pixels, as those do that hide fireflies.
    render_set("clamped", 201, 8, [](Rgb c) {
        return Rgb(std::min(c.r, 0.5f), std::min(c.g, 0.5f), std::min(c.b, 0.5f));
    });
    Arguments arguments{"verify", "--images"};
    for (int i = 0; i < 8; ++i) arguments.push_back(path(fmt::format("clamped/{}.exr", i)));
    arguments.insert(arguments.end(), {"--against", path("b"), "--tiles", "2"});
    const ProgramResult wrong = run(arguments);
    EXPECT_EQ(wrong.status, 1);
    EXPECT_NE(wrong.output.find("the expectations DIFFER"), std::string::npos) << wrong.output;
    EXPECT_NE(wrong.errors.find("the expectations of the images differ"), std::string::npos)
        << wrong.errors;
}

TEST_F(ImagesTest, ThatCannotBeTestedAreRefused) {
    render_set("a", 1, 2);
    render_set("b", 11, 2);
    const auto verify = [&](const std::string& images, const Arguments& more = {}) {
        Arguments all{"verify", "--images", images, "--against", path("b")};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    expect_refusal({"verify", "--images", path("a")}, "--images requires --against");
    expect_refusal({"verify"}, "SCENE, or --images");
    expect_refusal(verify(path("a"), {"--spp", "4"}), "--images excludes --spp");
    expect_refusal(verify(path("none")), "none: there is no such file or folder");
    expect_refusal(verify(path("a/0.exr")), "a/0.exr: expected at least two independent images");
    expect_refusal(verify(path("b")), "has the same pixels as");
    fs::create_directories(path("empty"));
    expect_refusal(verify(path("empty")), "empty: there is no .exr or .pfm file");

    const RgbImage image = rendered(3, 1);
    write("display.png", image);
    expect_refusal(verify(path("display.png")), "display.png: expected an .exr or .pfm file");
    RgbImage bad = image;
    bad.pixels[14].g = std::numeric_limits<float>::quiet_NaN();
    write("nan/0.exr", bad);
    expect_refusal(verify(path("nan")), "nan/0.exr: pixel (2, 1) is (");
    write("size/0.exr", {1, 1, {Rgb(1)}});
    write("size/1.exr", {1, 1, {Rgb(2)}});
    expect_refusal(verify(path("size")), "size/0.exr: has 1 x 1 pixels, but");
    Image depth(12, 12, {"depth.Z"});
    fs::create_directories(path("depth"));
    write_image(path("depth/0.exr"), depth);
    expect_refusal(verify(path("depth")),
                   "depth/0.exr: there are no channels R, G, B (but: depth.Z)");
    std::ofstream(path("broken.exr")) << "v/1\1";
    expect_refusal(verify(path("broken.exr")), "broken.exr");
}

/// The results replace no image, and the verdict is told even if they cannot be written.
TEST_F(ImagesTest, AreNotReplacedByResults) {
    render_set("a", 1, 2);
    render_set("b", 11, 2);
    const auto arguments = [&](const std::string& json) {
        return Arguments{"verify",    "--images", path("a/0.exr"), path("a/1.exr"),
                         "--against", path("b"),  "--tiles",       "1",
                         "--json",    json};
    };
    for (const char* file : {"a/1.exr", "b/0.exr"}) {
        const std::string before = read_text(path(file));
        expect_refusal(arguments(path(file)), "cannot be the same file");
        EXPECT_EQ(read_text(path(file)), before);
    }
    const ProgramResult full = run(arguments("/dev/full"));
    EXPECT_EQ(full.status, 1);
    EXPECT_NE(full.output.find("verdict: "), std::string::npos) << full.output;
    EXPECT_NE(full.errors.find("/dev/full"), std::string::npos) << full.errors;
}

TEST_F(ImagesTest, ArePartOfTheReport) {
    // Twice as bright, so that their error is known.
    for (int run = 1; run <= 2; ++run)
        for (int k = 0; k < 3; ++k)
            write(fmt::format("other/seed{}-{}spp-{}s.exr", run, 4 << k, 0.5 * (1 << k)),
                  rendered(10 * run + k, 4 << k), [](Rgb c) { return c * 2.0f; });
    const Arguments compare{"compare",
                            scene,
                            "-m",
                            "path:max_depth=4",
                            "--spp",
                            "16",
                            "--resolution",
                            "12x12",
                            "--reference-spp",
                            "1024",
                            "--reference-method",
                            "path:max_depth=4",
                            "--report",
                            path("report"),
                            "--references",
                            path("references"),
                            "--techniques-max-depth",
                            "0"};
    Arguments all = compare;
    all.insert(all.end(), {"--images", "other=" + path("other")});
    const ProgramResult r = run(all);
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.output.find("other "), std::string::npos) << r.output;
    const nlohmann::json j = nlohmann::json::parse(read_text(path("report/report.json")));
    const nlohmann::json& m = j["scenes"][0]["methods"][1];
    EXPECT_EQ(m["name"], "other");
    EXPECT_EQ(m["folder"], path("other"));
    EXPECT_TRUE(m["integrator"].is_null());
    ASSERT_EQ(m["runs"].size(), 2u);
    ASSERT_EQ(m["runs"][0]["checkpoints"].size(), 3u);
    EXPECT_EQ(m["runs"][1]["checkpoints"][1]["spp"], 8);
    EXPECT_EQ(m["runs"][1]["checkpoints"][1]["seconds"], 1);
    EXPECT_EQ(m["summary"]["seconds"], 2);
    EXPECT_NEAR(m["summary"]["mean_ratio"]["value"].get<double>(), 2, 0.4);
    // Of two images, the error of the mean has one degree of freedom.
    EXPECT_LT(m["summary"]["mean_ratio"]["low_95"].get<double>(), 1);
    EXPECT_TRUE(fs::exists(path("report/cornell/other.exr")));
    EXPECT_NE(read_text(path("report/report.html")).find("\"other\""), std::string::npos);

    // Names that would be those of other files of the report.
    all = compare;
    all.push_back("--images");
    for (const char* name : {"reference", "a b", "a_b", "a_b-flip"})
        all.push_back(name + ("=" + path("other")));
    const ProgramResult named = run(all);
    ASSERT_EQ(named.status, 0) << named.errors;
    for (const char* name : {"reference-2", "a_b", "a_b-2", "a_b-flip-2"})
        for (const char* end : {".exr", ".png", "-flip.png", "-relse.png"})
            EXPECT_TRUE(fs::exists(path(fmt::format("report/cornell/{}{}", name, end))))
                << name << end;
    EXPECT_EQ(read_image(path("report/cornell/a_b.exr")).data,
              read_image(path("report/cornell/reference-2.exr")).data);
    EXPECT_NE(read_image(path("report/cornell/reference.exr")).data,
              read_image(path("report/cornell/reference-2.exr")).data);

    const auto refuse = [&](const std::string& images, const std::string& message) {
        Arguments wrong = compare;
        wrong.insert(wrong.end(), {"--images", images});
        expect_refusal(wrong, message);
    };
    refuse(path("other"), "--images must have the form NAME=FOLDER");
    refuse("x=" + path("none"), "none: ");
    Arguments twice = compare;
    twice.insert(twice.end(), {"--images", "x=" + path("other"), "x=" + path("other")});
    expect_refusal(twice, "method \"x\" is given twice");
    write("untimed/a.exr", rendered(1, 1));
    refuse("x=" + path("untimed"),
           "untimed/a.exr: expected a name that ends with the rendering time");
    write("small/1s.exr", {1, 1, {Rgb(1)}});
    refuse("x=" + path("small"), "small/1s.exr: has 1 x 1 pixels, but the scene has 12 x 12");
    write("twice/1s.exr", rendered(1, 1));
    write("twice/1.0s.exr", rendered(2, 1));
    refuse("x=" + path("twice"), "have the same time in the same run");
}

}  // namespace
}  // namespace etendue::test
