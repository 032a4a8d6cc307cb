#pragma once
// The protocol of a session, without sockets.

#include <atomic>
#include <future>
#include <optional>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"
#include "studio/api.h"
#include "test_scenes.h"
#include "wait_for.h"

namespace etendue::test {

/// A session and its protocol; the size of the image can be changed before the scene is loaded again.
class ApiFixture : public ::testing::Test {
protected:
    void open(ApiOptions options = {}, const std::string& lamp = "12,11,9") {
        lamp_ = lamp;
        session.emplace([this] { return scene(); }, 1, RunKeeping{.folder = runs});
        options.token = "secret";
        options.scene_file = (folder.path() / "room.xml").string();
        options.output_folder = folder.path().string();
        api.emplace(*session, std::move(options));
        ASSERT_TRUE(wait_for([&] { return session->scene() != nullptr; }));
    }
    Scene scene() const {
        return build(sensor("0,0,3.5", "0,0,0", size) + room() + area_lamp(lamp_));
    }
    void reload(int new_size) {
        size = new_size;
        const uint64_t before = session->scene_version();
        EXPECT_EQ(post("/v1/run", {{"action", "reload"}}).status, 200);
        ASSERT_TRUE(wait_for([&] { return session->scene_version() > before; }));
    }
    Reply ask(const std::string& method, const std::string& target, std::string body = {},
              const std::string& version = {}) {
        std::promise<Reply> answer;
        api->handle({.method = method,
                     .target = target,
                     .host = "localhost",
                     .origin = {},
                     .fetch_site = {},
                     .authorization = "Bearer secret",
                     .if_match = version,
                     .body = std::move(body),
                     .local_address = "127.0.0.1"},
                    [&](Reply reply) { answer.set_value(std::move(reply)); });
        return answer.get_future().get();
    }
    Reply get(const std::string& target) { return ask("GET", target); }
    Reply post(const std::string& target, const nlohmann::json& body) {
        return ask("POST", target, body.dump());
    }
    int start(const nlohmann::json& more) {
        nlohmann::json request{{"action", "start"}, {"integrator", "path"}, {"spp", 2}};
        request.update(more);
        const Reply reply = post("/v1/run", request);
        EXPECT_EQ(reply.status, 200) << reply.body;
        return nlohmann::json::parse(reply.body).value("run", 0);
    }
    int finished_run(const nlohmann::json& more = nlohmann::json::object()) {
        const int run = start(more);
        EXPECT_TRUE(wait_for([&] { return session->status(run).state == RunState::Finished; }));
        return run;
    }
    std::string saved(const std::string& name) const { return read_text(folder.path() / name); }

    TemporaryFolder folder;
    std::atomic<int> size = 16;
    std::string runs;  ///< The folder in which they are kept.
    std::optional<Session> session;
    std::optional<Api> api;

private:
    std::string lamp_;
};

}  // namespace etendue::test
