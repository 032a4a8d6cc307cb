// Denoising, which needs a library that may be missing, and its messages.

#include <stdlib.h>

#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/denoiser.h"
#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class DenoiseTest : public ::testing::Test {
protected:
    DenoiseTest() { ::unsetenv("VIRTUAL_ENV"); }
    ~DenoiseTest() override { ::unsetenv("ETENDUE_OIDN"); }

    /// Uses the library that scripts/test-python has installed; false if there is none.
    bool use_library() const {
        std::error_code error;
        const fs::path packages = fs::path(ETENDUE_SOURCE_DIR) / "build/venv/lib";
        for (const auto& python : fs::directory_iterator(packages, error)) {
            const fs::path folder = python.path() / "site-packages/pyoidn/oidn/lib";
            if (!fs::exists(folder, error)) continue;
            ::setenv("ETENDUE_OIDN", folder.c_str(), 1);
            return true;
        }
        return false;
    }
    ProgramResult run(const std::vector<std::string>& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    std::string file(const std::string& name) const { return folder.path() / name; }
    /// An image of one colour.
    std::string image(const std::string& name, int width, int height,
                      const std::string& denoised_by = "") const {
        const std::vector<Rgb> pixels(size_t(width) * size_t(height), Rgb(0.5f));
        Image i = rgb_image(width, height, pixels);
        add_rgb_layer(i, width, height, "variance", pixels);
        i.attributes["etendue.spp"] = 16.0;
        if (!denoised_by.empty()) i.attributes["etendue.denoised"] = denoised_by;
        write_image(file(name), i);
        return file(name);
    }
    void expect_refusal(const std::vector<std::string>& arguments, const std::string& message,
                        int status = 1) const {
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.status, status) << r.errors;
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_FALSE(fs::exists(file("out.exr")));
        EXPECT_FALSE(fs::exists(file("out.denoised.exr")));
    }

    TemporaryFolder folder;
    const std::string cornell = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
};

TEST_F(DenoiseTest, SaysHowToGetTheLibraryBeforeItRenders) {
    ::setenv("ETENDUE_OIDN", file("none.so").c_str(), 1);
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"denoise", image("in.exr", 8, 8), file("out.exr")},
          {"render", cornell, "-o", file("out.exr"), "--spp", "1", "--resolution", "8x8",
           "--denoise"}}) {
        expect_refusal(arguments, "cannot load Open Image Denoise 2 (" + file("none.so"));
        expect_refusal(arguments, "pip install pyoidn");
    }
}

TEST_F(DenoiseTest, RefusesAnotherLibrary) {
    ::setenv("ETENDUE_OIDN", "libm.so.6", 1);
    expect_refusal({"denoise", image("in.exr", 8, 8), file("out.exr")},
                   "libm.so.6 is no Open Image Denoise of version 2");
}

TEST_F(DenoiseTest, RefusesWrongImages) {
    const std::string in = image("in.exr", 8, 8), small = image("small.exr", 8, 7);
    expect_refusal({"denoise", file("none.exr"), file("out.exr")}, "none.exr");
    expect_refusal({"denoise", cornell, file("out.exr")}, "cornell.xml");
    expect_refusal({"denoise", in, file("out.jpg")}, "must end in .exr");
    expect_refusal({"denoise", in, in}, "cannot be the same file");
    expect_refusal({"denoise", in, file("out.exr"), "--albedo", small},
                   "in.exr\" has 8 x 8 pixels, but \"" + small + "\" has 8 x 7");
    expect_refusal({"denoise", in, file("out.exr"), "--albedo", in, "--normal", small},
                   "has 8 x 7");
    expect_refusal({"denoise", in, file("out.exr"), "--normal", in}, "--albedo", 2);
    fs::create_symlink("/dev/null", file("device.exr"));
    expect_refusal({"render", cornell, "-o", file("device.exr"), "--denoise"},
                   "must therefore be a file");
}

/// Whatever it is, it is not evidence.
TEST_F(DenoiseTest, DenoisedImagesAreNoReferences) {
    const std::string denoised = image("denoised.exr", 8, 8, "a denoiser"),
                      other = image("other.exr", 8, 8), refusal = "the image is denoised";
    expect_refusal({"verify", cornell, "--resolution", "8x8", "--reference", denoised}, refusal);
    expect_refusal({"compare", cornell, "--resolution", "8x8", "--methods", "path", "--spp", "1",
                    "--reference", denoised, "--report", file("report")},
                   refusal);
    const ProgramResult ok = run({"diff", denoised, other});
    EXPECT_EQ(ok.status, 0);
    EXPECT_EQ(ok.errors, "");
    for (const std::vector<std::string>& references :
         {std::vector<std::string>{denoised}, {other, "--reference2", denoised}}) {
        std::vector<std::string> all{"diff", other};
        all.insert(all.end(), references.begin(), references.end());
        const ProgramResult warned = run(all);
        EXPECT_EQ(warned.status, 0);
        EXPECT_NE(warned.errors.find("warning: " + denoised + ": " + refusal), std::string::npos)
            << warned.errors;
    }
}

TEST_F(DenoiseTest, InfoTellsWhatIsDenoised) {
    const std::string denoised = image("denoised.exr", 8, 4, "a denoiser"),
                      other = image("other.exr", 8, 4);
    EXPECT_EQ(run({"info", denoised}).output,
              denoised + ": denoised image\n  size      8 x 4\n"
                         "  channels  R, G, B, variance.R, variance.G, variance.B\n"
                         "  etendue.denoised  a denoiser\n  etendue.spp  16\n");
    EXPECT_EQ(run({"info", other}).output.find("denoised"), std::string::npos);
    const auto j = nlohmann::json::parse(run({"info", denoised, "--json"}).output);
    EXPECT_EQ(j["denoised"], true);
    EXPECT_EQ(j["attributes"]["etendue.spp"], 16);
    EXPECT_EQ(nlohmann::json::parse(run({"info", other, "--json"}).output)["denoised"], false);
}

TEST_F(DenoiseTest, RendersAndDenoises) {
    if (!use_library()) GTEST_SKIP() << "there is no pyoidn in build/venv";
    const std::vector<std::string> render{
        "render", cornell, "--resolution", "64x64", "--spp",
        "16",     "-i",    "path",         "--aov", "denoise_albedo,denoise_normal"};
    const auto with = [&](std::vector<std::string> all, const std::vector<std::string>& more) {
        all.insert(all.end(), more.begin(), more.end());
        return run(all);
    };
    const ProgramResult r = with(render, {"-o", file("a.exr"), "--denoise"});
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.errors.find("a.denoised.exr: denoised in"), std::string::npos) << r.errors;
    const Image noisy = read_image(file("a.exr")), denoised = read_image(file("a.denoised.exr"));
    EXPECT_FALSE(is_denoised(noisy));
    EXPECT_TRUE(is_denoised(denoised));
    EXPECT_EQ(std::get<std::string>(noisy.attributes.at("etendue.estimator")), "unbiased");
    EXPECT_EQ(std::get<std::string>(denoised.attributes.at("etendue.estimator")), "denoised");
    EXPECT_FALSE(denoised.attributes.contains("etendue.mean_luminance"));
    EXPECT_EQ(denoised.channels, (std::vector<std::string>{"R", "G", "B"}));

    // Samples of a pixel stay in it, so that errors are independent.
    ASSERT_EQ(with(render, {"-o", file("sample.exr"), "--filter-mode", "sample"}).status, 0);
    EXPECT_EQ(read_image(file("sample.exr")).data, noisy.data);
    ASSERT_EQ(
        with(render, {"-o", file("spread.exr"), "--denoise", "--filter-mode", "spread"}).status, 0);
    ASSERT_EQ(with(render, {"-o", file("usual.exr")}).status, 0);
    EXPECT_EQ(read_image(file("usual.exr")).data, read_image(file("spread.exr")).data);

    // The same by the other command, with any number of threads.
    ASSERT_EQ(run({"denoise", file("a.exr"), file("again.exr"), "--threads", "1"}).status, 0);
    EXPECT_EQ(read_image(file("again.exr")).data, denoised.data);
    expect_refusal({"denoise", file("again.exr"), file("twice.exr")},
                   "again.exr\": the image is denoised already");

    // It removes noise.
    ASSERT_EQ(run({"render", cornell, "--resolution", "64x64", "--spp", "1024", "-i", "path", "-o",
                   file("reference.exr"), "--quiet"})
                  .status,
              0);
    const auto error = [&](const char* of) {
        return nlohmann::json::parse(run({"diff", file(of), file("reference.exr"), "--json"})
                                         .output)["rel_mse_trimmed"]
            .get<double>();
    };
    EXPECT_LT(error("a.denoised.exr"), 0.3 * error("a.exr"));
    EXPECT_GT(error("a.denoised.exr"), 0);

    // Layers of other names, or files, guide it as well.
    ASSERT_EQ(run({"denoise", file("a.exr"), file("plain.exr"), "--albedo", file("a.exr")}).status,
              0);
    EXPECT_NE(read_image(file("plain.exr")).data, denoised.data);
    write_image(file("albedo.exr"), rgb_image(64, 64, rgb_pixels(noisy, "denoise_albedo")));
    write_image(file("normal.exr"), rgb_image(64, 64, rgb_pixels(noisy, "denoise_normal")));
    ASSERT_EQ(run({"denoise", file("sample.exr"), file("files.exr"), "--albedo", file("albedo.exr"),
                   "--normal", file("normal.exr")})
                  .status,
              0);
    EXPECT_EQ(read_image(file("files.exr")).data, denoised.data);
}

}  // namespace
}  // namespace etendue::test
