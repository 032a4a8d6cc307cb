// The denoised image of a run, by a library that is not there, a false one, and the true one where it is installed.

#include <stdlib.h>

#include <chrono>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "api_fixture.h"
#include "image/denoiser.h"
#include "image_body.h"

namespace etendue::test {
namespace {

using nlohmann::json;

class DenoisedTest : public ApiFixture {
protected:
    DenoisedTest() {
        ::unsetenv("VIRTUAL_ENV");
        ::setenv("ETENDUE_OIDN", ETENDUE_FAKE_DENOISER, 1);
    }
    ~DenoisedTest() override {
        api.reset();
        ::unsetenv("ETENDUE_OIDN");
        ::unsetenv("FAKE_DENOISER_SECONDS");
    }
    static void last(double seconds) {
        ::setenv("FAKE_DENOISER_SECONDS", std::to_string(seconds).c_str(), 1);
    }
    Reply denoised(int run, uint64_t after = 0) {
        return get("/v1/image?view=denoised&run=" + std::to_string(run) +
                   "&after=" + std::to_string(after));
    }
    /// The image that a page gets, which asks at every event.
    Reply awaited(int run, uint64_t after = 0) {
        Reply reply;
        EXPECT_TRUE(wait_for([&] {
            reply = denoised(run, after);
            return reply.status != 204;
        }));
        return reply;
    }
    std::string difference(const std::string& run, const std::string& against) {
        return get("/v1/difference?run=" + run + "&against=" + against).body;
    }
};

TEST_F(DenoisedTest, TheLatestImageOfARunIsDenoised) {
    open();
    const int run = finished_run({{"spp", 4}});
    const uint64_t revision = api->revision();
    const Reply reply = awaited(run);
    ASSERT_EQ(reply.status, 200) << reply.body;
    EXPECT_GT(api->revision(), revision);  // So that pages ask for it.
    EXPECT_EQ(field_at(reply.body, 2), 4u);
    const auto noisy = session->snapshot(run);
    Rgb mean;
    for (const Rgb c : noisy->mean) mean += c / float(noisy->mean.size());
    for (const size_t pixel : {0, 100, 255})
        for (size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(value_at(reply.body, 3 * pixel + c), mean[int(c)], 2e-3f * mean[int(c)]);
    // There is nothing newer, and nothing is computed.
    const uint64_t done = api->revision();
    EXPECT_EQ(denoised(run, 4).status, 204);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(api->revision(), done);
    // More passes, another image.
    EXPECT_EQ(post("/v1/run", {{"action", "continue"}, {"run", run}, {"spp", 8}}).status, 200);
    ASSERT_TRUE(wait_for([&] { return session->status(run).state == RunState::Finished; }));
    EXPECT_EQ(field_at(awaited(run, 4).body, 2) > 4, true);
    EXPECT_EQ(denoised(99).status, 422);
}

TEST_F(DenoisedTest, ItIsNeitherTheImageNorAReference) {
    open();
    const int run = finished_run({{"spp", 4}});
    const std::string id = std::to_string(run), view = "denoised:" + id;
    EXPECT_EQ(json::parse(get("/v1/pixel?x=3&y=4&view=" + view).body)["passes"], 0);
    ASSERT_EQ(awaited(run).status, 200);
    const json of_run = json::parse(get("/v1/pixel?x=3&y=4&run=" + id).body),
               shown = json::parse(get("/v1/pixel?x=3&y=4&view=" + view).body);
    EXPECT_FALSE(of_run["half"].is_null());
    EXPECT_EQ(shown["passes"], 4);
    EXPECT_EQ(shown["interval"], "none");
    EXPECT_TRUE(shown["half"].is_null());
    EXPECT_NE(shown["mean"], of_run["mean"]);
    // It is measured, but nothing is measured against it.
    EXPECT_GT(json::parse(difference(view, id))["rel_mse"].get<double>(), 0);
    EXPECT_NE(difference(id, view).find("biased"), std::string::npos);
    // What is saved is the run's own.
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "a.exr"}}).status, 200);
    const Image file = read_image((folder.path() / "a.exr").string());
    EXPECT_FALSE(is_denoised(file));
    EXPECT_EQ(rgb_pixels(file), session->snapshot(run)->mean);
}

TEST_F(DenoisedTest, OpenedImagesThatAreDenoisedAreNoReferences) {
    open();
    const int run = finished_run();
    Image image = rgb_image(16, 16, std::vector<Rgb>(256, Rgb(0.25f)));
    image.attributes["etendue.denoised"] = std::string("2.3");
    const std::string file = (folder.path() / "a.exr").string();
    write_image(file, image);
    EXPECT_EQ(ask("POST", "/v1/images?file=a.exr", read_text(file)).status, 200);
    const std::string id = std::to_string(run);
    EXPECT_NE(difference(id, "opened:1").find("biased"), std::string::npos);
    EXPECT_EQ(difference("opened:1", id).find("biased"), std::string::npos);
}

TEST_F(DenoisedTest, SaysHowToGetTheLibrary) {
    ::setenv("ETENDUE_OIDN", (folder.path() / "none.so").c_str(), 1);
    open();
    const int run = finished_run();
    const Reply reply = awaited(run);
    EXPECT_EQ(reply.status, 422);
    EXPECT_NE(reply.body.find("pip install pyoidn"), std::string::npos) << reply.body;
    // Told once; the next request tries again.
    ::setenv("ETENDUE_OIDN", ETENDUE_FAKE_DENOISER, 1);
    EXPECT_EQ(awaited(run).status, 200);
}

/// While a run renders, the thread rests; the image at the end does not wait.
TEST_F(DenoisedTest, FollowsARunWithRests) {
    last(0.05);
    open();
    const int run = start({{"spp", 1000000}});
    ASSERT_EQ(awaited(run).status, 200);
    const auto begin = std::chrono::steady_clock::now();
    uint64_t passes = 1;
    constexpr int kImages = 3;
    for (int i = 0; i < kImages; ++i) {
        const Reply reply = awaited(run, passes);
        ASSERT_EQ(reply.status, 200);
        EXPECT_GT(field_at(reply.body, 2), passes);
        passes = field_at(reply.body, 2);
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    // An image is three filters; before it there is a rest.
    EXPECT_GT(taken.count(), kImages * 3 * 0.05 * (1 + DenoisedImages::kRest) * 0.9);
    EXPECT_EQ(post("/v1/run", {{"action", "stop"}, {"run", run}}).status, 200);
    ASSERT_TRUE(wait_for([&] { return session->status(run).state == RunState::Stopped; }));
    const uint64_t last_pass = session->snapshot(run)->passes;
    ASSERT_TRUE(wait_for([&] { return field_at(awaited(run, 0).body, 2) == last_pass; }));
}

TEST_F(DenoisedTest, IsCancelledWithItsRun) {
    last(1000);
    open();
    const int run = finished_run();
    EXPECT_EQ(denoised(run).status, 204);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(post("/v1/run", {{"action", "remove"}, {"run", run}}).status, 200);
    // Also before the session has removed it.
    EXPECT_EQ(denoised(run).status, 422);
    // The thread is free for another run.
    last(0);
    EXPECT_EQ(awaited(finished_run()).status, 200);
    // The end of the program does not wait for it.
    last(1000);
    const int other = finished_run();
    EXPECT_EQ(denoised(other).status, 204);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const auto begin = std::chrono::steady_clock::now();
    api.reset();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

TEST_F(DenoisedTest, ImagesOfAnotherSizeAreNotShown) {
    open();
    const int run = finished_run();
    ASSERT_EQ(awaited(run).status, 200);
    reload(24);
    EXPECT_EQ(denoised(run).status, 409);
    reload(16);
    EXPECT_EQ(awaited(run).status, 200);
}

TEST_F(DenoisedTest, OpenImageDenoiseRemovesNoise) {
    ::unsetenv("ETENDUE_OIDN");
    ::setenv("VIRTUAL_ENV", ETENDUE_SOURCE_DIR "/build/denoiser", 1);
    try {
        Denoiser();
    } catch (const std::runtime_error& e) {
        GTEST_SKIP() << "Open Image Denoise is not installed: " << e.what();
    }
    size = 64;
    open();
    const int reference = finished_run({{"spp", 256}, {"filter_mode", "sample"}}),
              run = finished_run({{"spp", 4}, {"filter_mode", "sample"}, {"seed", 1}});
    ASSERT_EQ(awaited(run).status, 200);
    const auto rel_mse = [&](const std::string& view) {
        return json::parse(difference(view, std::to_string(reference)))["rel_mse"].get<double>();
    };
    EXPECT_LT(rel_mse("denoised:" + std::to_string(run)), 0.3 * rel_mse(std::to_string(run)));
}

}  // namespace
}  // namespace etendue::test
