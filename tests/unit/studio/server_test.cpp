// The server with a session in one process, which thread sanitizers can see: clients in threads of their own.

#include "studio/server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <random>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "studio/api.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

using nlohmann::json;

Scene small_room() {
    return build(sensor("0,0,3.5", "0,0,0", 16) + room() + area_lamp() +
                 sphere("0.3,-0.5,0.1", "0.4", "<bsdf type=\"conductor\"/>"));
}

/// The status of the reply to a request; 0 without one. Reads at most `most` bytes of it.
int ask(int port, const std::string& method, const std::string& target, const std::string& body,
        size_t most = SIZE_MAX) {
    const int s = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(uint16_t(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    std::string reply;
    if (::connect(s, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
        const std::string request =
            method + " " + target +
            " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer secret\r\n"
            "Connection: close\r\nContent-Length: " +
            std::to_string(body.size()) + "\r\n\r\n" + body;
        char buffer[4096];
        if (::send(s, request.data(), request.size(), MSG_NOSIGNAL) == ssize_t(request.size()))
            for (ssize_t n; reply.size() < most && (n = ::recv(s, buffer, sizeof buffer, 0)) > 0;)
                reply.append(buffer, size_t(n));
    }
    ::close(s);
    constexpr size_t kBeforeStatus = sizeof("HTTP/1.1");
    return reply.size() > kBeforeStatus + 3 ? std::stoi(reply.substr(kBeforeStatus, 3)) : 0;
}

/// Runs are started, watched, traced again, stopped, discarded and removed by four clients at a time, while the scene is
/// loaded again and events are sent.
TEST(Server, AnswersSeveralClientsAtATime) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("etendue-server-" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder);
    Session session(small_room, 2);
    Api api(session, {.token = "secret",
                      .scene_file = (folder / "room.xml").string(),
                      .output_folder = folder.string(),
                      .reference = {}});
    Server server("127.0.0.1", 0);
    server.start(api);
    const int port = server.port();
    while (!session.scene()) std::this_thread::yield();
    const auto run_request = [](const std::string& action, int run) {
        return json{{"action", action}, {"run", run}}.dump();
    };
    const auto client = [&](uint32_t seed) {
        std::mt19937 random(seed);
        const auto pick = [&](const auto& list) {
            return std::string(list[random() % std::size(list)]);
        };
        constexpr int kRequests = 150;
        for (int i = 0; i < kRequests; ++i) {
            const int run = 1 + int(random() % 4);
            const std::string of_run = "run=" + std::to_string(run);
            const char* views[] = {"image", "error",  "variance", "first",
                                   "depth", "normal", "length:2", "technique:0"};
            const char* actions[] = {"stop", "stop", "continue", "continue", "discard", "remove"};
            const char* methods[] = {"path", "bdpt", "vcm", "mlt:groups=2,chains=16"};
            int status = 0;
            switch (random() % 12) {
            case 0:
                status = ask(port, "POST", "/v1/run",
                             json{{"action", "start"},
                                  {"integrator", pick(methods)},
                                  {"spp", 1 + random() % 200},
                                  {"techniques", random() % 4},
                                  {"seeds", 1 + random() % 2}}
                                 .dump());
                break;
            case 1: status = ask(port, "POST", "/v1/run", run_request(pick(actions), run)); break;
            case 2: status = ask(port, "GET", "/v1/pixel?x=3&y=4&w=5&h=2&" + of_run, ""); break;
            case 3:
                status =
                    ask(port, "POST", "/v1/replay", json{{"run", run}, {"x", 8}, {"y", 9}}.dump());
                break;
            case 4: status = ask(port, "GET", "/v1/geometry", ""); break;
            case 5: status = ask(port, "GET", "/v1/difference?against=1&" + of_run, ""); break;
            case 6:
                status = ask(port, "GET", "/v1/gain?without=1&with=" + std::to_string(run), "");
                break;
            case 7: status = ask(port, "GET", "/v1/state", ""); break;
            case 8:
                status =
                    ask(port, "POST", "/v1/save", json{{"run", run}, {"file", "a.pfm"}}.dump());
                break;
            case 9:
                status = random() % 8 == 0 ? ask(port, "POST", "/v1/run", run_request("reload", 1))
                                           : ask(port, "GET", "/v1/events", "", 600);
                break;
            default: status = ask(port, "GET", "/v1/image?view=" + pick(views) + "&" + of_run, "");
            }
            EXPECT_NE(status, 0);
        }
    };
    for (int i = 0; i < 3; ++i)
        EXPECT_EQ(ask(port, "POST", "/v1/run", json{{"action", "start"}, {"techniques", 3}}.dump()),
                  200);
    std::vector<std::thread> clients;
    for (uint32_t i = 0; i < 4; ++i) clients.emplace_back(client, i);
    for (std::thread& t : clients) t.join();
    EXPECT_EQ(ask(port, "GET", "/v1/state", ""), 200);
    server.stop();
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace etendue::test
