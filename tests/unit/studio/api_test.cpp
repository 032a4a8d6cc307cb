// What the protocol answers, without sockets: images of another size than the scene, files that exist, replays of runs of
// an earlier scene.

#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "api_fixture.h"
#include "image/image.h"
#include "image/image_io.h"
#include "image_body.h"
#include "limited_memory.h"
#include "system/available_memory.h"
#include "system/memory_limit.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class ApiTest : public ApiFixture {};

TEST_F(ApiTest, AReferenceOfAnotherSizeIsNotShown) {
    for (const auto& [width, height] : {std::pair{8, 8}, {16, 8}, {8, 32}, {16, 17}}) {
        session.reset();
        open(
            {.token = {},
             .scene_file = {},
             .output_folder = {},
             .reference = RgbImage{width, height, std::vector<Rgb>(size_t(width) * size_t(height))},
             .hosts = {}});
        const Reply reply = get("/v1/image?view=reference");
        EXPECT_EQ(reply.status, 409) << width << " x " << height;
        const json state = json::parse(get("/v1/state").body);
        EXPECT_EQ(state["has_reference"], false);
        EXPECT_NE(state["reference_problem"].get<std::string>().find(std::to_string(width) + " × " +
                                                                     std::to_string(height)),
                  std::string::npos)
            << state;
        api.reset();
    }
}

TEST_F(ApiTest, AReferenceOfTheSameSizeIsShown) {
    open({.token = {},
          .scene_file = {},
          .output_folder = {},
          .reference = RgbImage{16, 16, std::vector<Rgb>(256, Rgb(0.5f))},
          .hosts = {}});
    const Reply reply = get("/v1/image?view=reference");
    ASSERT_EQ(reply.status, 200);
    EXPECT_EQ(value_at(reply.body, 5), 0.5f);
    EXPECT_EQ(json::parse(get("/v1/state").body)["has_reference"], true);
    reload(20);
    EXPECT_EQ(get("/v1/image?view=reference").status, 409);
    EXPECT_EQ(json::parse(get("/v1/state").body)["has_reference"], false);
}

TEST_F(ApiTest, ImagesOfARunOfASceneOfAnotherSizeAreNotShown) {
    open();
    const int run = finished_run({{"integrator", "bdpt"}, {"techniques", 3}});
    const std::string of_run = "&run=" + std::to_string(run);
    ASSERT_TRUE(wait_for([&] { return get("/v1/image?view=length:2" + of_run).status == 200; }));
    const json list =
        json::parse(get("/v1/techniques?run=" + std::to_string(run)).body)["techniques"];
    ASSERT_FALSE(list.empty());
    std::vector<std::string> views{"image", "variance", "error", "length:2"};
    for (const char* kind : {"technique:", "unweighted:"})
        views.push_back(kind + list[0]["key"].get<std::string>());
    for (const std::string& view : views)
        EXPECT_EQ(get("/v1/image?view=" + view + of_run).status, 200) << view;
    for (const int other : {24, 8}) {
        reload(other);
        for (const std::string& view : views)
            EXPECT_EQ(get("/v1/image?view=" + view + of_run).status, 409) << view;
    }
    reload(16);
    for (const std::string& view : views)
        EXPECT_EQ(get("/v1/image?view=" + view + of_run).status, 200) << view;
}

TEST_F(ApiTest, NumbersOfQueriesAreReadWhole) {
    open();
    const int run = finished_run({{"integrator", "bdpt"}, {"techniques", 3}});
    const auto status = [&](const std::string& query) {
        return get("/v1/image?run=" + std::to_string(run) + "&" + query).status;
    };
    ASSERT_TRUE(wait_for([&] { return status("view=length:2") == 200; }));
    EXPECT_EQ(status("rect=1,2,3,4"), 200);
    for (const char* wrong :
         {"rect=", "rect=1,2,3", "rect=1,2,3,", "rect=1,2,3,4x", "rect=1,2,3,4,5", "rect=1, 2,3,4",
          "rect=1,2,3,99999999999", "view=length:", "view=length:2x", "view=length:two"})
        EXPECT_EQ(status(wrong), 400) << wrong;
}

/// A view is of the same technique, whichever others are found later.
TEST_F(ApiTest, TechniquesAreNamedNotNumbered) {
    open();
    const int run = finished_run({{"integrator", "bdpt"}, {"techniques", 3}});
    const std::string of_run = "&run=" + std::to_string(run);
    json list;
    ASSERT_TRUE(wait_for([&] {
        list = json::parse(get("/v1/techniques?run=" + std::to_string(run)).body)["techniques"];
        return !list.empty();
    }));
    const auto shown = session->techniques(run);
    ASSERT_EQ(list.size(), shown->images.size());
    for (size_t i = 0; i < list.size(); ++i) {
        const Reply reply =
            get("/v1/image?view=unweighted:" + list[i]["key"].get<std::string>() + of_run);
        ASSERT_EQ(reply.status, 200) << list[i];
        for (size_t pixel = 0; pixel < 256; ++pixel)
            ASSERT_NEAR(value_at(reply.body, 3 * pixel), shown->images[i].unweighted[pixel].r,
                        1e-3f * (1 + shown->images[i].unweighted[pixel].r));
    }
    EXPECT_EQ(get("/v1/image?view=technique:nothing" + of_run).status, 404);
}

/// Half floats have 5 bits of exponent: 6e-8 is the least value.
TEST_F(ApiTest, DimImagesKeepTheirDigits) {
    open({}, "1.2e-6,1.1e-6,9e-7");
    const int run = finished_run();
    const std::string of_run = "&run=" + std::to_string(run);
    const auto shown = session->snapshot(run);
    const Reply image = get("/v1/image?view=image" + of_run),
                variance = get("/v1/image?view=variance" + of_run);
    float largest = 0;
    for (const Rgb v : shown->variance) largest = std::max({largest, v.r, v.g, v.b});
    for (size_t pixel = 0; pixel < 256; ++pixel)
        for (size_t c = 0; c < 3; ++c) {
            const float mean = shown->mean[pixel][int(c)], squared = shown->variance[pixel][int(c)];
            EXPECT_NEAR(value_at(image.body, 3 * pixel + c), mean, 2e-3f * mean);
            EXPECT_NEAR(value_at(variance.body, 3 * pixel + c), squared,
                        2e-3f * squared + 1e-9f * largest);
        }
}

TEST_F(ApiTest, FilesAreNotReplacedUnasked) {
    open();
    const int run = finished_run();
    std::ofstream(folder.path() / "mine.pfm") << "mine";
    const Reply refused = post("/v1/save", {{"run", run}, {"file", "mine.pfm"}});
    EXPECT_EQ(refused.status, 409);
    EXPECT_NE(refused.body.find("mine.pfm"), std::string::npos) << refused.body;
    EXPECT_EQ(saved("mine.pfm"), "mine");
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "mine.pfm"}, {"overwrite", false}}).status,
              409);
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "mine.pfm"}, {"overwrite", "yes"}}).status,
              422);
    const Reply asked = post("/v1/save", {{"run", run}, {"file", "mine.pfm"}, {"overwrite", true}});
    EXPECT_EQ(asked.status, 200) << asked.body;
    EXPECT_EQ(saved("mine.pfm").substr(0, 2), "PF");
    EXPECT_EQ(json::parse(asked.body)["passes"], 2);
    // Neither links nor folders are replaced, nor written through.
    std::ofstream(folder.path() / "secret") << "secret";
    fs::create_symlink(folder.path() / "secret", folder.path() / "link.pfm");
    fs::create_symlink(folder.path() / "nothing", folder.path() / "broken.pfm");
    fs::create_directory(folder.path() / "folder.pfm");
    for (const char* name : {"link.pfm", "broken.pfm", "folder.pfm"})
        for (const bool overwrite : {false, true})
            EXPECT_EQ(
                post("/v1/save", {{"run", run}, {"file", name}, {"overwrite", overwrite}}).status,
                409)
                << name;
    EXPECT_EQ(saved("secret"), "secret");
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link.pfm"));
    EXPECT_FALSE(fs::exists(folder.path() / "nothing"));
    // The same name twice at a time.
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "new.pfm"}}).status, 200);
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "new.pfm"}}).status, 409);
}

TEST_F(ApiTest, FilesThatAreNoPathsAreNotReplacedByPaths) {
    open();
    const json list = json::array({{{"points", {{0, 1, 0}, {0, 0, 0}}}, {"name", "mine"}}});
    const std::string version = get("/v1/paths?file=new.json").etag;
    const auto put = [&](const char* name) {
        return ask("PUT", std::string("/v1/paths?file=") + name, list.dump(), version);
    };
    const std::string large = "[" + std::string(size_t(2) << 20, ' ') + "]";
    std::ofstream(folder.path() / "large.json") << large;
    std::ofstream(folder.path() / "report.json") << "{\"spp\": 3}";
    std::ofstream(folder.path() / "secret.json") << "[]";
    fs::create_symlink(folder.path() / "secret.json", folder.path() / "link.json");
    for (const char* name : {"large.json", "report.json", "link.json"}) {
        EXPECT_GE(get(std::string("/v1/paths?file=") + name).status, 400) << name;
        EXPECT_GE(put(name).status, 400) << name;
    }
    EXPECT_EQ(saved("large.json"), large);
    EXPECT_EQ(saved("report.json"), "{\"spp\": 3}");
    EXPECT_EQ(saved("secret.json"), "[]");
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link.json"));
    EXPECT_EQ(put("new.json").status, 200);
}

TEST_F(ApiTest, DeepJsonIsRefused) {
    open();
    const std::string deep(size_t(1) << 20, '[');
    const std::string whole = std::string(size_t(1) << 19, '[') + std::string(size_t(1) << 19, ']');
    const std::string version = get("/v1/paths?file=new.json").etag;
    for (const std::string& text :
         {deep, whole,
          std::string("[{\"points\":") + whole.substr(100, whole.size() - 200) + "}]"}) {
        EXPECT_GE(ask("PUT", "/v1/paths?file=new.json", text, version).status, 400);
        EXPECT_GE(ask("POST", "/v1/paths/check", "{\"paths\":" + text + "}").status, 400);
        EXPECT_GE(ask("POST", "/v1/paths/snap", "{\"index\":1,\"points\":" + text + "}").status,
                  400);
        EXPECT_GE(ask("POST", "/v1/ray", "{\"origin\":" + text + ",\"direction\":[0,0,1]}").status,
                  400);
    }
    EXPECT_EQ(get("/v1/state").status, 200);
}

/// Rays and points that are far out of the scene, or equal, have an answer.
TEST_F(ApiTest, ExtremeRaysHaveAnswers) {
    open();
    for (const double v : {1e-40, 1e-20, 1e20, 3e38, -3e38}) {
        EXPECT_EQ(
            post("/v1/ray", {{"origin", {0, 0, 0}}, {"direction", {v, v, 0}}, {"trace", true}})
                    .status /
                100 % 2,
            0);
        EXPECT_EQ(post("/v1/ray", {{"origin", {v, 0, v}}, {"direction", {-v, 0, -v}}}).status /
                      100 % 2,
                  0);
        for (int index = 0; index < 4; ++index)
            EXPECT_EQ(post("/v1/paths/snap",
                           {{"index", index},
                            {"points", {{0, 0.9, 0}, {v, 0, 0}, {v, 0, 0}, {0, -v, v}}}})
                              .status /
                          100 % 2,
                      0);
        EXPECT_EQ(post("/v1/paths/check",
                       {{"paths", {{{"points", {{0, 0.9, 0}, {v, 0, 0}, {v, 0, 0}, {0, -v, v}}}}}}})
                          .status /
                      100 % 2,
                  0);
    }
    for (int index = 0; index < 4; ++index)
        EXPECT_EQ(post("/v1/paths/snap",
                       {{"index", index}, {"points", {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}})
                      .status,
                  200);
}

TEST_F(ApiTest, NamesThePassThatMadeAPixelBright) {
    open();
    const int run = finished_run({{"spp", 16}});
    const std::string of = "/v1/worst?run=" + std::to_string(run);
    const json worst = json::parse(get(of + "&count=5").body);
    EXPECT_EQ(worst["passes"], 16);
    ASSERT_EQ(worst["pixels"].size(), 5u);
    for (const json& w : worst["pixels"]) {
        const std::string pixel = "&x=" + w["x"].dump() + "&y=" + w["y"].dump();
        EXPECT_EQ(json::parse(get(of + pixel).body)["pixel"], w);
        const json replayed = json::parse(
            post("/v1/replay",
                 {{"run", run}, {"x", w["x"]}, {"y", w["y"]}, {"pass", w["pass"]}, {"passes", 1}})
                .body);
        const auto sum = [&](int c) { return replayed["sum"][size_t(c)].get<float>(); };
        EXPECT_NEAR(luminance(Rgb(sum(0), sum(1), sum(2))), w["value"].get<float>(),
                    1e-3f * w["value"].get<float>());
    }
    EXPECT_EQ(get(of + "&x=16&y=0").status, 422);
    EXPECT_EQ(get(of + "&count=0").status, 422);
    EXPECT_EQ(get("/v1/worst?run=77").status, 422);
    const int chains = finished_run({{"integrator", "pssmlt"}});
    EXPECT_TRUE(json::parse(get("/v1/worst?run=" + std::to_string(chains)).body)["pixels"].empty());
}

/// Also of methods that share light paths, or learn.
TEST_F(ApiTest, TracesThePassThatMadeAPixelBright) {
    open();
    for (const char* method : {"upg", "pcbpt", "path:guide=on", "vcm", "sppm"}) {
        const int run = finished_run({{"integrator", method}, {"spp", 20}});
        const json worst =
            json::parse(get("/v1/worst?count=3&run=" + std::to_string(run)).body)["pixels"];
        ASSERT_EQ(worst.size(), 3u) << method;
        for (const json& w : worst) {
            const json replayed = json::parse(post("/v1/replay", {{"run", run},
                                                                  {"x", w["x"]},
                                                                  {"y", w["y"]},
                                                                  {"pass", w["pass"]},
                                                                  {"most", 10000}})
                                                  .body);
            EXPECT_EQ(replayed["pass"], w["pass"]) << method;
            ASSERT_FALSE(replayed.contains("is_last_pass")) << method;
            float sum = 0;
            for (const json& path : replayed["paths"]) {
                const json& v = path["value"];
                sum += luminance(Rgb(v[0].get<float>(), v[1].get<float>(), v[2].get<float>()));
            }
            EXPECT_NEAR(sum, w["value"].get<float>(), 2e-3f * w["value"].get<float>()) << method;
        }
        const json last = json::parse(post("/v1/replay", {{"run", run}, {"x", 3}, {"y", 4}}).body);
        EXPECT_EQ(last["is_last_pass"], true) << method;
    }
}

TEST_F(ApiTest, ChangesWhatIsRendered) {
    SceneView view;
    ApiOptions options;
    options.set_view = [&](const SceneView& v) { view = v; };
    open(std::move(options));
    const auto change = [&](const json& what) {
        json body{{"action", "view"}};
        body.update(what);
        return post("/v1/run", body).status;
    };
    const uint64_t version = session->scene_version();
    EXPECT_EQ(change({{"crop", {{"x", 2}, {"y", 3}, {"w", 4}, {"h", 5}}}}), 200);
    EXPECT_EQ(view.crop, (std::array<int, 4>{2, 3, 4, 5}));
    EXPECT_TRUE(wait_for([&] { return session->scene_version() > version; }));
    EXPECT_EQ(change({{"camera", {{"eye", {0, 0, 3}}, {"target", {0, 0, 0}}, {"up", {0, 1, 0}}}}}),
              200);
    ASSERT_TRUE(view.camera);
    EXPECT_EQ(view.camera->eye.z, 3);
    EXPECT_TRUE(view.crop);
    EXPECT_EQ(change({{"crop", nullptr}}), 200);
    EXPECT_FALSE(view.crop);
    EXPECT_TRUE(view.camera);
    EXPECT_EQ(change({{"sensor", 0}}), 200);
    EXPECT_FALSE(view.camera);
    for (const json& wrong :
         {json{{"sensor", 1}}, json{{"crop", {{"x", 0}}}},
          json{{"crop", {{"x", 10}, {"y", 0}, {"w", 7}, {"h", 1}}}}, json{{"crop", 3}},
          json{{"camera", {{"eye", {0, 0, 3}}}}},
          json{{"camera", {{"eye", {0, 0, 3}}, {"target", {0, 0, 3}}, {"up", {0, 1, 0}}}}}})
        EXPECT_EQ(change(wrong), 422) << wrong;
}

TEST_F(ApiTest, KeptRunsAreListedAndOpened) {
    runs = (folder.path() / "runs").string();
    fs::create_directory(runs);
    open();
    const int first = finished_run({{"integrator", "bdpt"}, {"spp", 3}});
    session->settle();
    const json of_first = json::parse(get("/v1/state").body)["runs"][0];
    EXPECT_EQ(of_first["file"], "test-bdpt-1.etd");
    EXPECT_EQ(of_first["file_passes"], 3);
    EXPECT_EQ(of_first["file_problem"], "");
    EXPECT_TRUE(json::parse(get("/v1/state").body)["kept"].empty());
    const auto version = [&] { return json::parse(api->event())["kept_version"].get<int>(); };
    const int before = version();
    EXPECT_EQ(post("/v1/run", {{"action", "remove"}, {"run", first}}).status, 200);
    ASSERT_TRUE(wait_for([&] { return version() > before; }));
    std::ofstream(fs::path(runs) / "a name.etd") << "no state of a rendering";
    EXPECT_EQ(post("/v1/run", {{"action", "list"}}).status, 200);
    json kept;
    ASSERT_TRUE(wait_for([&] {
        kept = json::parse(get("/v1/state").body)["kept"];
        return kept.size() == 2;
    })) << kept;
    EXPECT_EQ(json::parse(get("/v1/state").body)["keeps_runs"], true);
    EXPECT_TRUE(kept[0].contains("problem")) << kept;
    EXPECT_EQ(
        kept[1],
        json({{"file", "test-bdpt-1.etd"}, {"integrator", "bdpt"}, {"seed", 0}, {"passes", 3}}));

    const Reply opened = post("/v1/run", {{"action", "open"}, {"file", "test-bdpt-1.etd"}});
    ASSERT_EQ(opened.status, 200) << opened.body;
    const int run = json::parse(opened.body)["run"].get<int>();
    const std::string id = std::to_string(run);
    EXPECT_EQ(get("/v1/image?view=image&run=" + id).status, 200);
    EXPECT_EQ(json::parse(get("/v1/pixel?x=3&y=4&run=" + id).body)["passes"], 3);
    EXPECT_EQ(post("/v1/run", {{"action", "continue"}, {"run", run}, {"spp", 5}}).status, 200);
    EXPECT_TRUE(wait_for([&] { return session->status(run).passes == 5; }));
}

TEST_F(ApiTest, ImagesOfFilesAreShownBesideRuns) {
    open();
    const int run = finished_run({{"integrator", "bdpt"}});
    EXPECT_EQ(post("/v1/save", {{"run", run}, {"file", "own.exr"}}).status, 200);
    const auto bring = [&](const std::string& name, const std::string& bytes) {
        const Reply reply = ask("POST", "/v1/images?file=" + name, bytes);
        EXPECT_EQ(reply.status, 200) << reply.body;
        return json::parse(reply.body).value("image", 0);
    };
    const auto state = [&] { return json::parse(get("/v1/state").body); };
    const auto version = [&] { return json::parse(api->event())["images_version"]; };
    const json before = version();
    const uint64_t revision = api->revision();
    const std::string own = "opened:" + std::to_string(bring("own.exr", saved("own.exr")));
    EXPECT_NE(version(), before);
    EXPECT_NE(api->revision(), revision);
    EXPECT_EQ(state()["images"], json::array({{{"id", 1},
                                               {"file", "own.exr"},
                                               {"note", "bdpt, 2 spp"},
                                               {"width", 16},
                                               {"height", 16}}}));

    const std::string of_run = std::to_string(run);
    EXPECT_EQ(get("/v1/image?view=" + own).body.substr(64),
              get("/v1/image?view=image&run=" + of_run).body.substr(64));
    json of_file = json::parse(get("/v1/pixel?x=3&y=4&view=" + own).body),
         in_run = json::parse(get("/v1/pixel?x=3&y=4&run=" + of_run).body);
    EXPECT_EQ(of_file["mean"], in_run["mean"]);
    EXPECT_TRUE(of_file["half"].is_null());
    EXPECT_EQ(of_file["interval"], "none");
    for (const std::string& pair :
         {"run=" + own + "&against=" + of_run, "run=" + of_run + "&against=" + own}) {
        const json d = json::parse(get("/v1/difference?" + pair).body);
        EXPECT_EQ(d["rel_mse"], 0) << d;
        EXPECT_EQ(d["flip"], 0) << d;
    }

    // Of another size, and what is not an image.
    Image large = rgb_image(20, 16, std::vector<Rgb>(320, Rgb(0.25f)));
    large.attributes["etendue.denoised"] = std::string("2.3");
    const std::string file = (folder.path() / "large.exr").string();
    write_image(file, large);
    const std::string other = "opened:" + std::to_string(bring("large.exr", read_text(file)));
    EXPECT_EQ(state()["images"][1]["note"], "denoised");
    EXPECT_EQ(get("/v1/image?view=" + other).status, 409);
    EXPECT_EQ(get("/v1/difference?run=" + own + "&against=" + other).status, 409);
    for (const char* name : {"a.exr", "a.etd", "a.png"})
        EXPECT_EQ(ask("POST", std::string("/v1/images?file=") + name, "no image").status, 422)
            << name;
    EXPECT_EQ(ask("POST", "/v1/images", saved("own.exr")).status, 422);

    EXPECT_EQ(ask("DELETE", "/v1/images?image=1").status, 200);
    EXPECT_EQ(ask("DELETE", "/v1/images?image=1").status, 404);
    EXPECT_EQ(get("/v1/image?view=" + own).status, 404);
    EXPECT_EQ(state()["images"].size(), 1u);
}

TEST_F(ApiTest, OpenedImagesHaveALimit) {
    open();
    const std::string file = (folder.path() / "a.pfm").string();
    write_image(file, rgb_image(3, 2, std::vector<Rgb>(6, Rgb(0.25f))));
    const std::string bytes = read_text(file);
    // Of one name, too.
    const auto status = [&] { return ask("POST", "/v1/images?file=a.pfm", bytes).status; };
    for (size_t i = 0; i < OpenedImages::kMost; ++i) EXPECT_EQ(status(), 200) << i;
    EXPECT_EQ(status(), 422);
    EXPECT_EQ(json::parse(get("/v1/state").body)["images"].size(), OpenedImages::kMost);
    EXPECT_EQ(ask("DELETE", "/v1/images?image=7").status, 200);
    EXPECT_EQ(status(), 200);
    EXPECT_EQ(get("/v1/image?view=opened:7").status, 404);
}

/// Neither by the server's thread, which sends no events meanwhile, nor by the worker.
TEST_F(ApiTest, FilesAreNotCopied) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    open();
    constexpr size_t kMebibyte = 1 << 20;
    for (const char* name : {"a.exr", "a.etd"}) {
        std::string bytes(64 * kMebibyte, ' ');
        limit_memory(memory_for_data("/proc").value() + 32 * kMebibyte);
        const Reply reply = ask("POST", std::string("/v1/images?file=") + name, std::move(bytes));
        unlimit_memory();
        EXPECT_EQ(reply.status, 422) << reply.body;
    }
}

TEST_F(ApiTest, KeptRunsOfAnyFolderAreShownAsImages) {
    runs = (folder.path() / "runs").string();
    fs::create_directory(runs);
    open();
    const int run = finished_run({{"integrator", "bdpt"}, {"spp", 3}});
    session->settle();
    const std::string file = read_text(fs::path(runs) / "test-bdpt-1.etd");
    const Reply reply = ask("POST", "/v1/images?file=elsewhere.etd", file);
    ASSERT_EQ(reply.status, 200) << reply.body;
    EXPECT_EQ(json::parse(get("/v1/state").body)["images"][0]["note"], "bdpt, 3 spp");
    const json of_file = json::parse(get("/v1/pixel?x=3&y=4&view=opened:1").body),
               in_run = json::parse(get("/v1/pixel?x=3&y=4&run=" + std::to_string(run)).body);
    for (const char* same : {"mean", "half", "passes", "interval"})
        EXPECT_EQ(of_file[same], in_run[same]) << same;
    EXPECT_FALSE(of_file["half"].is_null());
    // Whatever its name.
    EXPECT_EQ(ask("POST", "/v1/images?file=elsewhere.ETD", file).status, 200);
    EXPECT_EQ(json::parse(get("/v1/state").body)["images"][1]["note"], "bdpt, 3 spp");
    EXPECT_EQ(ask("POST", "/v1/images?file=torn.etd", file.substr(0, file.size() / 2)).status, 422);
}

/// As in the list of the runs, finished or not.
TEST_F(ApiTest, KeptRunsOfSeveralSeedsAreShownAsTheirMean) {
    runs = (folder.path() / "runs").string();
    fs::create_directory(runs);
    open();
    const json three{{"integrator", "bdpt"}, {"spp", 3}, {"seeds", 3}};
    const int finished = finished_run(three);
    // One is discarded in its second seed.
    // Ended between two seeds, or in one.
    const int under_way = start({{"integrator", "path"}, {"spp", 50}, {"seeds", 64}});
    ASSERT_TRUE(wait_for([&] { return session->status(under_way).finished_seeds > 0; }));
    EXPECT_EQ(post("/v1/run", {{"action", "stop"}, {"run", under_way}}).status, 200);
    ASSERT_TRUE(wait_for([&] { return session->status(under_way).state == RunState::Stopped; }));
    session->settle();
    int image = 0;
    for (const int run : {finished, under_way}) {
        const RunStatus status = session->status(run);
        const Reply reply =
            ask("POST", "/v1/images?file=elsewhere.etd", read_text(fs::path(runs) / status.file));
        ASSERT_EQ(reply.status, 200) << status.file << reply.body;
        const json note = json::parse(get("/v1/state").body)["images"][size_t(image)]["note"];
        EXPECT_EQ(note, status.request.integrator + ", " + std::to_string(status.passes) +
                            " spp, " + std::to_string(status.finished_seeds) + " of " +
                            std::to_string(status.seeds) + " seeds");
        const std::string view = "opened:" + std::to_string(++image), of_run = std::to_string(run);
        ASSERT_TRUE(wait_for([&] {
            return json::parse(get("/v1/pixel?x=3&y=4&run=" + of_run).body)["passes"] ==
                   status.passes;
        }));
        const json of_file = json::parse(get("/v1/pixel?x=3&y=4&view=" + view).body),
                   in_run = json::parse(get("/v1/pixel?x=3&y=4&run=" + of_run).body);
        for (const char* same : {"mean", "half", "passes", "interval"})
            EXPECT_EQ(of_file[same], in_run[same]) << same;
        const json d = json::parse(get("/v1/difference?run=" + view + "&against=" + of_run).body);
        EXPECT_EQ(d["rel_mse"], 0) << d;
    }
}

TEST_F(ApiTest, OnlyFilesOfTheFolderAreOpened) {
    const auto status = [&](const json& name) {
        return post("/v1/run", {{"action", "open"}, {"file", name}}).status;
    };
    runs = (folder.path() / "runs").string();
    fs::create_directory(runs);
    open();
    finished_run();
    session->settle();
    ASSERT_TRUE(fs::exists(fs::path(runs) / "test-path-1.etd"));
    fs::copy(fs::path(runs) / "test-path-1.etd", folder.path() / "outside.etd");
    fs::create_symlink(folder.path() / "outside.etd", fs::path(runs) / "link.etd");
    fs::copy(folder.path() / "outside.etd", fs::path(runs) / "other.name");
    fs::create_directory(fs::path(runs) / "folder.etd");
    for (const json& bad : {json("../outside.etd"), json((folder.path() / "outside.etd").string()),
                            json("outside.etd"), json("link.etd"), json("folder.etd"),
                            json("other.name"), json(""), json(3), json(nullptr)})
        EXPECT_EQ(status(bad), 422) << bad;
    EXPECT_EQ(session->runs().size(), 1u);
    // Without a folder, nothing is.
    api.reset();
    runs.clear();
    open();
    EXPECT_EQ(json::parse(get("/v1/state").body)["keeps_runs"], false);
    EXPECT_EQ(status("test-path-1.etd"), 422);
}

/// Also where they are empty again: the page keeps what it was told before.
TEST_F(ApiTest, EventsSayWhatIsNoLongerSo) {
    open();
    finished_run();
    const auto run = [&] { return json::parse(api->event())["runs"][0]; };
    EXPECT_EQ(run()["message"], "");
    EXPECT_EQ(run()["old_scene"], false);
    EXPECT_EQ(run()["file_problem"], "");
    reload(16);
    EXPECT_EQ(run()["old_scene"], true);
}

/// Names of files that were edited are not kept for ever.
TEST_F(ApiTest, EventsDoNotGrowWithTheFilesThatAreSaved) {
    open();
    const size_t before = api->event().size();
    const std::string version = get("/v1/paths?file=new.json").etag;
    for (int i = 0; i < 50; ++i)
        EXPECT_EQ(
            ask("PUT", "/v1/paths?file=p" + std::to_string(i) + ".json", "[]", version).status,
            200);
    EXPECT_LT(api->event().size(), before + 50);
}

}  // namespace
}  // namespace etendue::test
