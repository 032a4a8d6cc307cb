// `etendue studio`: what its server answers and refuses, which files it touches, and how it ends.

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <regex>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"
#include "wait_for.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using namespace std::chrono_literals;

struct Answer {
    int status = 0;  ///< 0: none.
    std::string head, body;
    json parsed() const { return json::parse(body, nullptr, false); }
};

/// A TCP connection to the server.
class Connection {
public:
    explicit Connection(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in to{};
        to.sin_family = AF_INET;
        to.sin_port = htons(uint16_t(port));
        to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        const timeval patience{20, 0};
        setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
        EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
    }
    ~Connection() { close(socket_); }
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    /// False where the server closed the connection.
    bool send(const std::string& text) const {
        for (size_t sent = 0; sent < text.size();) {
            const ssize_t n = ::send(socket_, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
            if (n <= 0) return false;
            sent += size_t(n);
        }
        return true;
    }
    /// Appends to `text` what comes next; false at the end.
    bool receive(std::string& text) const {
        char buffer[65536];
        const ssize_t n = recv(socket_, buffer, sizeof buffer, 0);
        if (n <= 0) return false;
        text.append(buffer, size_t(n));
        return true;
    }
    /// Reads until `enough(text)` or the end.
    template <class Enough>
    std::string read_until(const Enough& enough) const {
        std::string text;
        while (!enough(text) && receive(text)) {
        }
        return text;
    }

private:
    int socket_;
};

Answer parse(const std::string& text) {
    Answer a;
    const size_t end = text.find("\r\n\r\n");
    if (end == std::string::npos || !text.starts_with("HTTP/1.1 ")) return a;
    a.status = std::stoi(text.substr(9, 3));
    a.head = text.substr(0, end + 2);
    a.body = text.substr(end + 4);
    return a;
}

std::string field(const Answer& a, const std::string& name) {
    std::smatch m;
    const std::regex pattern(name + ": (.*)\r", std::regex::icase);
    return std::regex_search(a.head, m, pattern) ? m[1].str() : "";
}

class StudioTest : public ::testing::Test {
protected:
    StudioTest() {
        const std::string text = read_text(fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml");
        fs::create_directory(folder.path() / "scene");
        std::ofstream(scene) << text;
    }
    ~StudioTest() override {
        if (!program) return;
        program->interrupt();
        program->wait();
    }
    void start(std::vector<std::string> more = {"--idle"}) {
        std::vector<std::string> arguments{"studio", scene,  "--resolution", "40x30",
                                           "-o",     output, "--threads",    "1"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        fs::remove(folder.path() / "stdout.txt");  // of an earlier program
        program.emplace(ETENDUE_PROGRAM, arguments, folder.path());
        std::smatch m;
        std::string printed;
        for (int i = 0; i < 2000; ++i) {
            printed = read_text(folder.path() / "stdout.txt");
            if (std::regex_search(
                    printed, m,
                    std::regex("http://127\\.0\\.0\\.1:(\\d+)/#token=([0-9a-f]{32})\n")))
                break;
            std::this_thread::sleep_for(10ms);
        }
        ASSERT_EQ(m.size(), 3u) << printed << program->errors();
        port = std::stoi(m[1]);
        token = m[2];
        for (int i = 0; i < 2000 && get("/v1/state").parsed()["scene"].is_null(); ++i)
            std::this_thread::sleep_for(10ms);
    }
    ProgramResult stop() {
        program->interrupt();
        const ProgramResult r = program->wait();
        program.reset();
        return r;
    }
    std::string host() const { return "127.0.0.1:" + std::to_string(port); }
    Answer ask(const std::string& method, const std::string& target,
               std::map<std::string, std::string> fields, const std::string& body = {}) const {
        fields.emplace("Host", host());
        std::string text = method + " " + target + " HTTP/1.1\r\nConnection: close\r\n";
        if (!body.empty()) fields["Content-Length"] = std::to_string(body.size());
        for (const auto& [name, value] : fields) text += name + ": " + value + "\r\n";
        const Connection c(port);
        c.send(text + "\r\n" + body);
        return parse(c.read_until([](const std::string&) { return false; }));
    }
    std::string bearer() const { return "Bearer " + token; }
    Answer get(const std::string& target) const {
        return ask("GET", target, {{"Authorization", bearer()}});
    }
    Answer post(const std::string& target, const json& body) const {
        return ask("POST", target, {{"Authorization", bearer()}}, body.dump());
    }
    json wait_for_run(int id, const std::string& state) const {
        for (int i = 0; i < 2000; ++i) {
            const json runs = get("/v1/state").parsed()["runs"];
            for (const json& run : runs)
                if (run["id"] == id && run["state"] == state) return run;
            std::this_thread::sleep_for(10ms);
        }
        ADD_FAILURE() << "run " << id << " is not " << state;
        return {};
    }

    TemporaryFolder folder;
    const std::string scene = folder.path() / "scene" / "box.xml", output = folder.path() / "out";
    std::optional<Program> program;
    int port = 0;
    std::string token;
};

TEST_F(StudioTest, AnswersOnlyItsOwnPage) {
    start();
    EXPECT_EQ(get("/v1/state").status, 200);
    EXPECT_EQ(ask("GET", "/v1/state", {}).status, 401);
    EXPECT_EQ(ask("GET", "/v1/state", {{"Authorization", token}}).status, 401);
    EXPECT_EQ(ask("GET", "/v1/state", {{"Authorization", "Bearer " + std::string(32, '0')}}).status,
              401);
    EXPECT_EQ(ask("GET", "/v1/events", {}).status, 401);
    // The page is public, but not under another name.
    for (const char* target : {"/", "/main.js", "/studio.css"}) {
        const Answer a = ask("GET", target, {});
        EXPECT_EQ(a.status, 200) << target;
        EXPECT_NE(field(a, "Content-Security-Policy").find("default-src 'none'"),
                  std::string::npos);
        EXPECT_EQ(field(a, "Access-Control-Allow-Origin"), "");
    }
    for (const char* bad : {"evil.example", "127.0.0.2", "localhost.evil.example", "[::1]", "",
                            "127.0.0.1.evil.example:80"})
        for (const char* target : {"/", "/v1/state"})
            EXPECT_EQ(ask("GET", target, {{"Host", bad}, {"Authorization", bearer()}}).status, 403)
                << bad;
    for (const char* good : {"localhost", "LocalHost:1234", "127.0.0.1:99"})
        EXPECT_EQ(ask("GET", "/v1/state", {{"Host", good}, {"Authorization", bearer()}}).status,
                  200)
            << good;
    const auto with = [&](const std::string& name, const std::string& value) {
        return ask("GET", "/v1/state", {{"Authorization", bearer()}, {name, value}}).status;
    };
    EXPECT_EQ(with("Origin", "http://" + host()), 200);
    EXPECT_EQ(with("Origin", "http://evil.example"), 403);
    EXPECT_EQ(with("Origin", "null"), 403);
    EXPECT_EQ(with("Origin", "https://" + host()), 403);
    EXPECT_EQ(with("Sec-Fetch-Site", "same-origin"), 200);
    EXPECT_EQ(with("Sec-Fetch-Site", "cross-site"), 403);
    EXPECT_EQ(with("Sec-Fetch-Site", "same-site"), 403);
    EXPECT_EQ(ask("OPTIONS", "/v1/state", {{"Origin", "http://evil.example"}}).status, 403);
}

TEST_F(StudioTest, HasNothingElse) {
    start();
    std::ofstream(fs::path(output) / "secret.txt") << "secret";
    for (const char* target :
         {"/nothing", "/v1", "/v1/nothing", "/../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
          "/..%2f..%2fetc/passwd", "//etc/passwd", "/main.js/", "/main.js%00", "/secret.txt",
          "/v1/../main.js", "/v1/state/", "/index.html"}) {
        const Answer a = get(target);
        EXPECT_EQ(a.status, 404) << target << a.body;
        EXPECT_EQ(a.body.find("root:"), std::string::npos);
    }
    EXPECT_EQ(ask("POST", "/v1/state", {{"Authorization", bearer()}}, "{}").status, 405);
    EXPECT_EQ(ask("DELETE", "/", {}).status, 405);
    EXPECT_EQ(ask("GET", "/v1/run", {{"Authorization", bearer()}}).status, 405);
}

TEST_F(StudioTest, LimitsWhatIsSent) {
    start();
    // A body that is announced, or only sent, too large.
    EXPECT_EQ(ask("POST", "/v1/run", {{"Authorization", bearer()}}, std::string((1 << 20) + 1, 'x'))
                  .status,
              413);
    {
        const Connection c(port);
        c.send("POST /v1/run HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
        std::string chunk = "10000\r\n" + std::string(0x10000, 'x') + "\r\n";
        for (int i = 0; i < 64 && c.send(chunk); ++i) {
        }
        EXPECT_EQ(parse(c.read_until([](const std::string&) { return false; })).status, 413);
    }
    {
        const Connection c(port);
        c.send("GET / HTTP/1.1\r\n");
        int sent = 0;
        while (sent < 64 << 20 && c.send("X-" + std::string(1000, 'a') + ": b\r\n")) sent += 1006;
        EXPECT_LT(sent, 40 << 20) << "an endless header is cut off";
    }
    {
        const Connection c(port);
        c.send("GET / HTTP/1.1\r\nX: " + std::string(9000, 'a') + "\r\n\r\n");
        EXPECT_EQ(parse(c.read_until([](const std::string&) { return false; })).status, 431);
    }
    for (const std::string& garbage :
         {std::string("hello\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
          std::string("\x16\x03\x01\x02\x00\x01\x00\x01", 8) + std::string(200, '\0')}) {
        const Connection c(port);
        c.send(garbage);
        EXPECT_EQ(parse(c.read_until([](const std::string&) { return false; })).status, 400);
    }
    EXPECT_EQ(get("/v1/state").status, 200);
}

TEST_F(StudioTest, RefusesTheFifthPageAndTooManyConnections) {
    start();
    const std::string request =
        "GET /v1/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: " + bearer() + "\r\n\r\n";
    const auto has_event = [](const std::string& s) {
        return s.find("\"runs\"") != std::string::npos;
    };
    {
        std::vector<std::unique_ptr<Connection>> pages;
        for (int i = 0; i < 4; ++i) {
            pages.push_back(std::make_unique<Connection>(port));
            pages.back()->send(request);
            EXPECT_EQ(parse(pages.back()->read_until(has_event)).status, 200);
        }
        const Connection fifth(port);
        fifth.send(request);
        const auto has_header = [](const std::string& s) {
            return s.find("\r\n\r\n") != std::string::npos;
        };
        EXPECT_EQ(parse(fifth.read_until(has_header)).status, 429);
    }
    std::this_thread::sleep_for(300ms);
    {
        const Connection again(port);
        again.send(request);
        EXPECT_EQ(parse(again.read_until(has_event)).status, 200);
    }
    // Connections without the token keep nobody out, and leave descriptors for files.
    std::vector<std::unique_ptr<Connection>> all;
    for (int i = 0; i < 300; ++i) all.push_back(std::make_unique<Connection>(port));
    EXPECT_EQ(get("/v1/state").status, 200);
    EXPECT_LT(program->open_files(), 150);
}

TEST_F(StudioTest, RunsAreStartedAndRefusedInWords) {
    start();
    const Answer bad = post("/v1/run", {{"action", "start"}, {"integrator", "bdpt:nonsense=1"}});
    EXPECT_EQ(bad.status, 422);
    EXPECT_NE(bad.body.find("nonsense"), std::string::npos) << bad.body;
    for (const json& wrong :
         {json{{"action", "fly"}, {"run", 1}}, json{{"action", "stop"}, {"run", 9}},
          json{{"action", "stop"}}, json{{"action", "start"}, {"spp", -1}},
          json{{"action", "start"}, {"spp", 1e300}}, json{{"action", 3}},
          json{{"action", "start"}, {"sampler", "halton"}},
          json{{"action", "start"}, {"filter_mode", "box"}}})
        EXPECT_EQ(post("/v1/run", wrong).status, 422) << wrong;
    EXPECT_EQ(ask("POST", "/v1/run", {{"Authorization", bearer()}}, "[[[").status, 400);
    const Answer started =
        post("/v1/run", {{"action", "start"}, {"integrator", "path"}, {"spp", 5}});
    ASSERT_EQ(started.status, 200) << started.body;
    const int id = started.parsed()["run"];
    EXPECT_EQ(wait_for_run(id, "finished")["passes"], 5);
    const std::string run = "run=" + std::to_string(id);
    const Answer image = get("/v1/image?view=image&" + run);
    EXPECT_EQ(image.status, 200);
    EXPECT_EQ(image.body.size(), 64 + 40 * 30 * 3 * 2u);
    EXPECT_EQ(get("/v1/image?view=image&level=2&" + run).body.size(), 64 + 10 * 8 * 3 * 2u);
    EXPECT_EQ(get("/v1/image?view=image&rect=3,4,5,6&" + run).body.size(), 64 + 5 * 6 * 3 * 2u);
    EXPECT_EQ(get("/v1/image?view=image&after=5&" + run).status, 204);
    for (const char* wrong : {"rect=0,0,41,1", "rect=-1,0,1,1", "rect=0,0,0,1", "rect=1",
                              "rect=2147483647,0,2147483647,1", "level=9", "level=-1", "level=x",
                              "view=nothing", "after=x"})
        EXPECT_NE(get("/v1/image?" + std::string(wrong) + "&" + run).status / 100, 2) << wrong;
    EXPECT_EQ(get("/v1/image?view=albedo").body.size(), 64 + 40 * 30 * 3 * 2u);
    const json pixel = get("/v1/pixel?x=20&y=15&" + run).parsed();
    EXPECT_EQ(pixel["passes"], 5);
    EXPECT_EQ(pixel["interval"], "upper");
    EXPECT_GT(pixel["half"][1], 0);
    EXPECT_EQ(get("/v1/pixel?x=40&y=15&" + run).status, 422);
}

TEST_F(StudioTest, TouchesFilesOfItsFoldersOnly) {
    start();
    const json start_run{{"action", "start"}, {"integrator", "path"}, {"spp", 2}};
    const int id = post("/v1/run", start_run).parsed()["run"];
    wait_for_run(id, "finished");
    for (const char* bad : {"../escaped.exr", "/escaped.exr", ".hidden.exr", "a/b.exr", "",
                            "a\\b.exr", "nul\n.exr", "picture.txt"}) {
        const Answer a = post("/v1/save", {{"run", id}, {"file", bad}});
        EXPECT_EQ(a.status, 422) << bad << a.body;
    }
    EXPECT_EQ(post("/v1/save", {{"run", id}, {"file", "good.exr"}}).status, 200);
    EXPECT_TRUE(fs::exists(fs::path(output) / "good.exr"));

    // Nothing is replaced unasked.
    const auto size = fs::file_size(fs::path(output) / "good.exr");
    std::ofstream(fs::path(output) / "good.exr") << "mine";
    EXPECT_EQ(post("/v1/save", {{"run", id}, {"file", "good.exr"}}).status, 409);
    EXPECT_EQ(read_text(fs::path(output) / "good.exr"), "mine");
    EXPECT_EQ(post("/v1/save", {{"run", id}, {"file", "good.exr"}, {"overwrite", true}}).status,
              200);
    EXPECT_EQ(fs::file_size(fs::path(output) / "good.exr"), size);

    // Links are neither read nor written through.
    const fs::path secret = folder.path() / "secret.json";
    std::ofstream(secret) << "[{\"name\": \"secret\", \"points\": [[0, 0, 0], [1, 1, 1]]}]";
    fs::create_symlink(secret, fs::path(output) / "link.json");
    EXPECT_EQ(get("/v1/paths?file=link.json").body.find("secret"), std::string::npos);
    for (const char* bad :
         {"../secret.json", "..%2fsecret.json", "%2e%2e/secret.json", "/etc/passwd", ".json"})
        EXPECT_EQ(get("/v1/paths?file=" + std::string(bad)).status, 422) << bad;
    const json list = json::array({{{"points", {{0, 1, 0}, {0, 0, 0}}}, {"name", "mine"}}});
    const std::string old = field(get("/v1/paths?file=none.json"), "ETag");
    EXPECT_EQ(ask("PUT", "/v1/paths?file=link.json",
                  {{"Authorization", bearer()}, {"If-Match", old}}, list.dump())
                  .status,
              409);
    EXPECT_TRUE(fs::is_symlink(fs::path(output) / "link.json"));
    EXPECT_NE(read_text(secret).find("secret"), std::string::npos);
    const Answer mlt =
        post("/v1/run", {{"action", "start"}, {"integrator", "mlt:user_paths=../secret.json"}});
    EXPECT_EQ(mlt.status, 422) << mlt.body;
}

TEST_F(StudioTest, StalePathsAreNotSaved) {
    start();
    const auto put = [&](const json& list, const std::string& version) {
        return ask("PUT", "/v1/paths?file=paths.json",
                   {{"Authorization", bearer()}, {"If-Match", version}}, list.dump());
    };
    const Answer empty = get("/v1/paths?file=paths.json");
    EXPECT_EQ(empty.parsed(), json::array());
    const json one = json::array({{{"points", {{0, 1, 0}, {0, 0, 0}}}, {"name", "one"}}});
    const Answer first = put(one, field(empty, "ETag"));
    ASSERT_EQ(first.status, 200) << first.body;
    const Answer stale = put(json::array(), field(empty, "ETag"));
    EXPECT_EQ(stale.status, 409);
    EXPECT_EQ(stale.parsed()[0]["name"], "one");
    EXPECT_EQ(put(json::array(), "").status, 409);
    EXPECT_NE(read_text(fs::path(output) / "paths.json").find("one"), std::string::npos);
    EXPECT_EQ(put(json::array(), field(first, "ETag")).status, 200);
    json many = json::array();
    for (int i = 0; i < 1001; ++i) many.push_back(one[0]);
    EXPECT_EQ(put(many, field(get("/v1/paths?file=paths.json"), "ETag")).status, 422);
    json bad = one;
    bad[0]["points"] = 3;
    EXPECT_EQ(put(bad, field(get("/v1/paths?file=paths.json"), "ETag")).status, 422);
}

TEST_F(StudioTest, ChecksPathsAndTracesAgain) {
    start();
    const json pick = post("/v1/paths/pick", {{"x", 20}, {"y", 25}, {"length", 3}}).parsed();
    ASSERT_TRUE(pick.is_array()) << pick;
    const json verdicts = post("/v1/paths/check", {{"paths", pick}}).parsed()["verdicts"];
    ASSERT_EQ(verdicts.size(), pick.size());
    for (const json& v : verdicts) EXPECT_EQ(v["ok"], true) << v;
    json moved = pick;
    moved[0]["points"][1][1] = 1e3;
    EXPECT_EQ(post("/v1/paths/check", {{"paths", moved}}).parsed()["verdicts"][0]["ok"], false);
    EXPECT_EQ(post("/v1/ray", {{"x", 20}, {"y", 25}}).parsed()["points"].size(), 1u);
    EXPECT_EQ(post("/v1/ray", {{"origin", {0, 0, 0}}, {"direction", {0, 0, 0}}}).status, 422);
    EXPECT_EQ(post("/v1/ray", {{"origin", {0, 0, "a"}}, {"direction", {0, 0, 1}}}).status, 422);
    EXPECT_EQ(post("/v1/ray", {{"x", 40}, {"y", 2}}).status, 422);
    const int id =
        post("/v1/run", {{"action", "start"}, {"integrator", "bdpt"}, {"spp", 2}}).parsed()["run"];
    wait_for_run(id, "finished");
    const json again =
        post("/v1/replay", {{"run", id}, {"x", 20}, {"y", 25}, {"passes", 8}}).parsed();
    ASSERT_TRUE(again["paths"].is_array()) << again;
    EXPECT_GT(again["paths"].size(), 0u);
    EXPECT_GT(again["sum"][1], 0);
    // Methods that share light paths have those of the last pass; chains have none.
    const int vcm =
        post("/v1/run", {{"action", "start"}, {"integrator", "vcm"}, {"spp", 3}}).parsed()["run"];
    wait_for_run(vcm, "finished");
    bool has_merges = false;
    for (int x = 0; x < 40 && !has_merges; ++x) {
        const json shared = post("/v1/replay", {{"run", vcm}, {"x", x}, {"y", 25}}).parsed();
        EXPECT_EQ(shared["is_last_pass"], true) << shared;
        for (const json& p : shared["paths"]) {
            EXPECT_EQ(p["pass"], 2);
            has_merges |= p["technique"]["strategy"] == "merge";
        }
    }
    EXPECT_TRUE(has_merges);
    const int mlt =
        post("/v1/run", {{"action", "start"}, {"integrator", "mlt"}, {"spp", 1}}).parsed()["run"];
    const Answer chains = post("/v1/replay", {{"run", mlt}, {"x", 20}, {"y", 25}});
    EXPECT_EQ(chains.status, 422);
    EXPECT_NE(chains.body.find("Markov chains"), std::string::npos);
    const Answer geometry = get("/v1/geometry");
    EXPECT_EQ(geometry.status, 200);
    EXPECT_GT(geometry.body.size(), 1000u);
}

TEST_F(StudioTest, MeasuresRectanglesAndDifferences) {
    start();
    const auto run = [&](const std::string& integrator, int spp, int seed) {
        const json request{{"action", "start"},
                           {"integrator", integrator},
                           {"spp", spp},
                           {"sampler", "independent"},
                           {"seed", seed}};
        return post("/v1/run", request).parsed()["run"].get<int>();
    };
    const int a = run("path", 4, 1), b = run("path", 64, 2);
    wait_for_run(a, "finished");
    wait_for_run(b, "finished");
    const std::string of_a = "run=" + std::to_string(a);
    // The values of a rectangle are those of its pixels.
    double sum = 0, squares = 0, least = 1e30, largest = 0, error2 = 0;
    const int n = 6 * 3;
    for (int y = 10; y < 13; ++y)
        for (int x = 7; x < 13; ++x) {
            const json one =
                get("/v1/pixel?" + of_a + "&x=" + std::to_string(x) + "&y=" + std::to_string(y))
                    .parsed();
            const double v = one["mean"][1], half = one["half"][1];
            sum += v, squares += v * v, error2 += half * half;
            least = std::min(least, v), largest = std::max(largest, v);
            EXPECT_FALSE(one.contains("least"));
        }
    const json all = get("/v1/pixel?" + of_a + "&x=7&y=10&w=6&h=3").parsed();
    EXPECT_NEAR(all["mean"][1], sum / n, 1e-6 * sum);
    EXPECT_NEAR(all["least"][1], least, 1e-6 * least);
    EXPECT_NEAR(all["largest"][1], largest, 1e-6 * largest);
    EXPECT_NEAR(all["variance"][1], (squares - sum * sum / n) / (n - 1), 1e-4 * squares);
    EXPECT_NEAR(all["half"][1], std::sqrt(error2) / n, 1e-5 * std::sqrt(error2));
    EXPECT_EQ(all["pixels"], n);
    EXPECT_EQ(all["nan"].get<int>() + all["infinite"].get<int>(), 0);
    EXPECT_EQ(get("/v1/pixel?" + of_a + "&x=38&y=10&w=6&h=3").status, 422);

    const auto difference = [&](int first, int second) {
        return get("/v1/difference?run=" + std::to_string(first) +
                   "&against=" + std::to_string(second));
    };
    const json d = difference(a, b).parsed();
    EXPECT_GT(d["rel_mse"], 0.001) << d;
    EXPECT_GT(d["flip"], 0.01) << d;
    EXPECT_LT(d["flip"], 1) << d;
    EXPECT_EQ(d["passes"], 4);
    EXPECT_EQ(d["against_passes"], 64);
    EXPECT_EQ(difference(b, b).parsed()["rel_mse"], 0);
    EXPECT_EQ(difference(b, b).parsed()["flip"], 0);
    EXPECT_EQ(difference(a, 99).status, 422);
    EXPECT_EQ(get("/v1/difference?" + of_a + "&against=reference").status, 404);
}

TEST_F(StudioTest, ComparesRunsWithSeveralSeeds) {
    start();
    const auto run = [&](int spp) {
        const json request{{"action", "start"}, {"integrator", "path:max_depth=3"},
                           {"spp", spp},        {"seeds", 6},
                           {"seed", 10 * spp},  {"sampler", "independent"}};
        return post("/v1/run", request).parsed()["run"].get<int>();
    };
    EXPECT_EQ(post("/v1/run", {{"action", "start"}, {"seeds", 3}}).status, 422);
    EXPECT_EQ(post("/v1/run", {{"action", "start"}, {"seeds", 65}, {"spp", 1}}).status, 422);
    const int few = run(1), many = run(16);
    const json status = wait_for_run(few, "finished");
    EXPECT_EQ(status["seeds"], json::array({6, 6}));
    EXPECT_EQ(status["passes"], 6);
    wait_for_run(many, "finished");
    const json g =
        get("/v1/gain?without=" + std::to_string(few) + "&with=" + std::to_string(many)).parsed();
    EXPECT_EQ(g["without"]["seeds"], 6) << g;
    EXPECT_EQ(g["means_differ"], false) << g;
    // Sixteen times as many samples.
    EXPECT_GT(g["ratio"], 9) << g;
    EXPECT_LT(g["ratio"], 25) << g;
    EXPECT_LT(g["gain"][1], g["gain"][0]);
    EXPECT_GT(g["gain"][2], g["gain"][0]);
    EXPECT_EQ(get("/v1/image?view=image&run=" + std::to_string(few)).status, 200);
}

class LongStudioTest : public StudioTest {};

/// Requests of four clients at a time with random members: each has an answer, and the server goes on.
TEST_F(LongStudioTest, FourRandomClients) {
    start({"-i", "path"});
    constexpr auto kLength = 20s;
    const auto end = std::chrono::steady_clock::now() + kLength;
    std::atomic<int> answers{0};
    const auto client = [&](uint32_t seed) {
        std::mt19937 random(seed);
        const auto pick = [&](const auto& list) { return list[random() % std::size(list)]; };
        const char* targets[] = {"/v1/state",
                                 "/v1/image?run=1&view=image",
                                 "/v1/run",
                                 "/v1/save",
                                 "/v1/ray",
                                 "/v1/paths/check",
                                 "/v1/paths/snap",
                                 "/v1/paths/pick",
                                 "/v1/replay",
                                 "/v1/paths?file=a.json",
                                 "/v1/pixel?run=1&x=3&y=4",
                                 "/v1/image?view=first",
                                 "/v1/image?run=1&view=error&level=2",
                                 "/v1/geometry",
                                 "/v1/techniques?run=1",
                                 "/v1/difference?run=1&against=2",
                                 "/v1/gain?without=1&with=2",
                                 "/"};
        const char* methods[] = {"GET", "POST", "POST", "PUT", "HEAD", "DELETE"};
        const char* names[] = {"action",     "run",        "x",      "y",         "points",
                               "paths",      "index",      "origin", "direction", "file",
                               "spp",        "integrator", "passes", "splats",    "length",
                               "techniques", "trace",      "seeds"};
        const json values[] = {1,
                               3,
                               -1,
                               1e300,
                               2.5,
                               nullptr,
                               true,
                               "start",
                               "stop",
                               "continue",
                               "path",
                               "light",
                               "../x",
                               "x.exr",
                               json::array({0, 0.5, 0.1}),
                               json::array({json::array({0, 1.9, 0}), json::array({0, 0, 0})}),
                               json::array({json{{"points", 3}}}),
                               json::object(),
                               18446744073709551615u};
        while (std::chrono::steady_clock::now() < end) {
            json body = json::object();
            for (int i = int(random() % 6); i > 0; --i) body[pick(names)] = pick(values);
            // A run without end would only be slow.
            if (body.contains("action") && body["action"] == "start") body["spp"] = 2;
            std::string text = body.dump();
            if (random() % 8 == 0) text = text.substr(0, random() % text.size());
            const Answer a = ask(pick(methods), pick(targets), {{"Authorization", bearer()}}, text);
            EXPECT_NE(a.status, 0) << text;
            EXPECT_NE(a.status / 100, 1);
            ++answers;
        }
    };
    std::vector<std::thread> clients;
    for (uint32_t i = 0; i < 4; ++i) clients.emplace_back(client, i);
    for (std::thread& t : clients) t.join();
    EXPECT_GT(answers, 40);
    EXPECT_EQ(get("/v1/state").status, 200);
    EXPECT_EQ(stop().status, 0);
}

TEST_F(StudioTest, CtrlCWritesAllImages) {
    start({"-i", "path"});
    post("/v1/run", {{"action", "start"}, {"integrator", "light"}});
    for (int i = 0; i < 2000; ++i) {
        const json runs = get("/v1/state").parsed()["runs"];
        if (runs.size() == 2 && runs[0]["passes"] > 0 && runs[1]["passes"] > 0) break;
        std::this_thread::sleep_for(10ms);
    }
    std::ofstream(fs::path(output) / "box-1.exr") << "an earlier image";
    const ProgramResult r = stop();
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(read_text(fs::path(output) / "box-1.exr"), "an earlier image");
    EXPECT_TRUE(fs::exists(fs::path(output) / "box-2.exr"));
    EXPECT_TRUE(fs::exists(fs::path(output) / "box-3.exr"));
}

/// Ctrl-C keeps the runs, and they go on the next time; nothing is written without --runs.
TEST_F(StudioTest, CtrlCKeepsRuns) {
    const fs::path runs = folder.path() / "runs";
    start({"-i", "bdpt", "--runs", runs});
    ASSERT_TRUE(wait_for([&] { return get("/v1/state").parsed()["runs"][0]["passes"] > 0; }));
    const ProgramResult first = stop();
    EXPECT_EQ(first.status, 0) << first.errors;
    EXPECT_NE(first.errors.find("box-bdpt-1.etd: run 1 is kept, bdpt"), std::string::npos)
        << first.errors;

    start({"--idle", "--runs", runs});
    json kept;
    ASSERT_TRUE(wait_for([&] {
        kept = get("/v1/state").parsed()["kept"];
        return kept.size() == 1;
    }));
    const uint64_t passes = kept[0]["passes"];
    EXPECT_GT(passes, 0u);
    // The image has the pass that was finished after Ctrl-C.
    EXPECT_EQ(
        std::get<double>(read_image(fs::path(output) / "box-1.exr").attributes.at("etendue.spp")),
        double(passes));
    EXPECT_EQ(post("/v1/run", {{"action", "open"}, {"file", kept[0]["file"]}}).status, 200);
    EXPECT_EQ(wait_for_run(1, "stopped")["passes"], passes);
    // What was only opened is written nowhere again.
    fs::remove_all(output);
    fs::create_directory(output);
    EXPECT_EQ(stop().status, 0);
    EXPECT_TRUE(fs::is_empty(output));

    start({"--idle", "--runs", runs});
    ASSERT_TRUE(wait_for([&] { return get("/v1/state").parsed()["kept"].size() == 1; }));
    post("/v1/run", {{"action", "open"}, {"file", kept[0]["file"]}});
    post("/v1/run", {{"action", "continue"}, {"run", 1}, {"spp", passes + 2}});
    EXPECT_EQ(wait_for_run(1, "finished")["passes"], passes + 2);
    // The run may still be written there.
    ASSERT_TRUE(wait_for([&] {
        std::error_code ignored;
        fs::remove_all(runs, ignored);
        std::ofstream(runs) << "no folder";
        return fs::is_regular_file(runs);
    }));
    post("/v1/run", {{"action", "continue"}, {"run", 1}, {"spp", passes + 3}});
    EXPECT_TRUE(wait_for(
        [&] { return get("/v1/state").parsed()["runs"][0]["passes"] == json(passes + 3); }));
    const ProgramResult last = stop();
    EXPECT_EQ(last.status, 1);
    EXPECT_NE(last.errors.find("run 1 is not kept: "), std::string::npos) << last.errors;
    EXPECT_FALSE(fs::is_empty(output)) << "the image is written";
}

/// Where the output folder cannot be written to, the images of all runs are saved among temporary files.
TEST_F(StudioTest, CtrlCSavesElsewhereWhatCannotBeSaved) {
    const fs::path other = folder.path() / "temporary";
    fs::create_directory(other);
    setenv("TMPDIR", other.c_str(), 1);
    start({"-i", "path"});
    unsetenv("TMPDIR");
    post("/v1/run", {{"action", "start"}, {"integrator", "light"}});
    const json several{{"action", "start"}, {"integrator", "path"}, {"spp", 2}, {"seeds", 50}};
    post("/v1/run", several);
    for (int i = 0; i < 2000; ++i) {
        const json runs = get("/v1/state").parsed()["runs"];
        if (runs.size() == 3 && runs[0]["passes"] > 0 && runs[1]["passes"] > 0 &&
            runs[2]["passes"] > 1)
            break;
        std::this_thread::sleep_for(10ms);
    }
    fs::remove_all(output);
    std::ofstream(output) << "no folder";
    const ProgramResult r = stop();
    EXPECT_EQ(r.status, 1);
    EXPECT_EQ(r.signal, 0);
    EXPECT_NE(r.errors.find("run 1: "), std::string::npos) << r.errors;
    for (const char* name : {"box-1.exr", "box-2.exr", "box-3.exr"}) {
        EXPECT_TRUE(fs::exists(other / name)) << name;
        EXPECT_NE(r.errors.find(other / name), std::string::npos) << r.errors;
    }
}

TEST_F(StudioTest, CanBeOpenedByNameAndFromElsewhere) {
    start({"--idle", "--listen", "0.0.0.0", "--host", "Studio.example"});
    const std::string printed = read_text(folder.path() / "stdout.txt");
    EXPECT_EQ(printed.find("http://Studio.example:" + std::to_string(port) + "/#token="), 0u)
        << printed;
    EXPECT_EQ(printed.find("0.0.0.0:"), std::string::npos);
    for (const auto& [name, status] : {std::pair{"studio.example", 200},
                                       {"STUDIO.example:99", 200},
                                       {"evil.example", 403},
                                       {"0.0.0.0", 403}})
        EXPECT_EQ(ask("GET", "/v1/state", {{"Host", name}, {"Authorization", bearer()}}).status,
                  status)
            << name;
    EXPECT_NE(program->errors().find("other machines"), std::string::npos);
}

TEST_F(StudioTest, SaysThatAReferenceHasAnotherSize) {
    const fs::path reference = folder.path() / "reference.pfm";
    std::ofstream(reference) << "PF\n2 2\n-1.0\n" << std::string(48, '\0');
    start({"--idle", "--reference", reference});
    EXPECT_EQ(get("/v1/image?view=reference").status, 409);
    for (int i = 0; i < 500 && program->errors().empty(); ++i) std::this_thread::sleep_for(10ms);
    EXPECT_NE(program->errors().find("2 × 2"), std::string::npos) << program->errors();
}

TEST_F(StudioTest, FailsBeforeItServes) {
    const auto expect = [&](const std::vector<std::string>& arguments, const std::string& message) {
        const ProgramResult r = Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_EQ(r.output, "");
    };
    expect({"studio", "missing.xml"}, "missing.xml");
    expect({"studio", scene, "-i", "nonsense"}, "nonsense");
    expect({"studio", scene, "--listen", "nowhere"}, "nowhere");
    expect({"studio", scene, "--host", "no name"}, "no name");
    expect({"studio", scene, "-o", scene}, "is not a folder");
    expect({"studio", scene, "--runs", scene}, "--runs");
}

/// Another place of an orthographic camera leaves the size of what it shows.
TEST_F(StudioTest, AnOrthographicViewShowsAsMuchElsewhere) {
    std::ofstream(scene) << R"(<scene version="3.0.0"><sensor type="orthographic">
        <transform name="to_world"><scale x="3" y="3"/><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
        </sensor><shape type="rectangle"><transform name="to_world"><scale value="2"/></transform></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate y="1" angle="90"/></transform></shape>
        <emitter type="constant"/></scene>)";
    start();
    const auto seen = [&](double x) {
        // The points under a pixel: one where its ray meets a rectangle.
        return post("/v1/ray", {{"x", int(20 + x * 20)}, {"y", 15}}).parsed()["points"].size();
    };
    EXPECT_GT(seen(0.5), seen(0.9));  // 1.5 of 2, and 2.7
    const json camera{{"eye", {5, 0, 0}}, {"target", {0, 0, 0}}, {"up", {0, 1, 0}}};
    EXPECT_EQ(post("/v1/run", {{"action", "view"}, {"camera", camera}}).status, 200);
    EXPECT_TRUE(wait_for([&] { return get("/v1/state").parsed()["scene_version"] == 2; }));
    EXPECT_GT(seen(0.5), seen(0.9));
}

TEST_F(StudioTest, SaysWhenTheSceneChangesAndLoadsItAgain) {
    start();
    const json old_run =
        post("/v1/run", {{"action", "start"}, {"integrator", "path"}, {"spp", 1}}).parsed()["run"];
    const auto replay = [&] {
        return post("/v1/replay", {{"run", old_run}, {"x", 20}, {"y", 15}});
    };
    for (int i = 0; i < 1000 && replay().status != 200; ++i) std::this_thread::sleep_for(10ms);
    EXPECT_EQ(replay().status, 200);
    const std::string text = read_text(scene);
    std::ofstream(scene) << text << " ";
    const std::string request =
        "GET /v1/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: " + bearer() + "\r\n\r\n";
    const Connection c(port);
    c.send(request);
    const std::string events = c.read_until(
        [](const std::string& s) { return s.find("\"scene_changed\":true") != std::string::npos; });
    EXPECT_NE(events.find("\"scene_changed\":true"), std::string::npos);
    std::ofstream(scene) << "<scene>";
    EXPECT_EQ(post("/v1/run", {{"action", "reload"}}).status, 200);
    for (int i = 0; i < 1000 && get("/v1/state").parsed()["load_error"] == ""; ++i)
        std::this_thread::sleep_for(10ms);
    const json state = get("/v1/state").parsed();
    EXPECT_NE(state["load_error"].get<std::string>().find("box.xml"), std::string::npos) << state;
    // The earlier scene stays.
    EXPECT_EQ(state["scene"]["width"], 40);
    EXPECT_EQ(state["scene_version"], 1);
    std::ofstream(scene) << text;
    EXPECT_EQ(post("/v1/run", {{"action", "reload"}}).status, 200);
    for (int i = 0; i < 1000 && get("/v1/state").parsed()["scene_version"] == 1; ++i)
        std::this_thread::sleep_for(10ms);
    const json again = get("/v1/state").parsed();
    EXPECT_EQ(again["scene_version"], 2);
    EXPECT_EQ(again["load_error"], "");
    // A request for another view loads the file, too.
    const Connection later(port);
    later.send(request);
    std::ofstream(scene) << text << "  ";
    const auto has_changed = [&] { return get("/v1/state").parsed()["scene_changed"] == true; };
    EXPECT_TRUE(wait_for(has_changed));
    EXPECT_EQ(post("/v1/run", {{"action", "view"}, {"sensor", 0}}).status, 200);
    EXPECT_TRUE(wait_for([&] { return get("/v1/state").parsed()["scene_version"] == 3; }));
    EXPECT_TRUE(wait_for([&] { return !has_changed(); }));
    const Answer stale = replay();
    EXPECT_EQ(stale.status, 409);
    EXPECT_NE(stale.body.find("earlier version"), std::string::npos) << stale.body;
}

}  // namespace
}  // namespace etendue::test
