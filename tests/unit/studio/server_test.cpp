// The server with a session in one process, which thread sanitizers can see: clients in threads of their own.

#include "studio/server.h"

#include <arpa/inet.h>
#include <malloc.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <new>
#include <optional>
#include <random>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "limited_memory.h"
#include "run_program.h"
#include "studio/api.h"
#include "studio/guard.h"
#include "system/available_memory.h"
#include "system/memory_limit.h"
#include "test_scenes.h"
#include "wait_for.h"

namespace etendue::test {
namespace {

using nlohmann::json;

Scene small_room() {
    return build(sensor("0,0,3.5", "0,0,0", 16) + room() + area_lamp() +
                 sphere("0.3,-0.5,0.1", "0.4", "<bsdf type=\"conductor\"/>"));
}

/// A connection to the server at an address of this machine.
class Client {
public:
    explicit Client(int port, const std::string& address = "127.0.0.1") {
        const bool is_v6 = address.find(':') != std::string::npos;
        socket_ = ::socket(is_v6 ? AF_INET6 : AF_INET, SOCK_STREAM, 0);
        const timeval patience{20, 0};
        ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        sockaddr_in v4{};
        v4.sin_family = AF_INET;
        v4.sin_port = htons(uint16_t(port));
        sockaddr_in6 v6{};
        v6.sin6_family = AF_INET6;
        v6.sin6_port = htons(uint16_t(port));
        if (is_v6)
            ::inet_pton(AF_INET6, address.c_str(), &v6.sin6_addr);
        else
            ::inet_pton(AF_INET, address.c_str(), &v4.sin_addr);
        is_connected_ = ::connect(socket_,
                                  is_v6 ? reinterpret_cast<const sockaddr*>(&v6)
                                        : reinterpret_cast<const sockaddr*>(&v4),
                                  is_v6 ? sizeof v6 : sizeof v4) == 0;
    }
    ~Client() {
        if (socket_ >= 0) ::close(socket_);
    }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    bool is_connected() const { return is_connected_; }
    void send(const std::string& text) const {
        (void)::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    }
    /// What the server sends, until it closes the connection, or `most` bytes.
    std::string receive(size_t most = SIZE_MAX) const {
        std::string reply;
        char buffer[4096];
        for (ssize_t n; reply.size() < most && (n = ::recv(socket_, buffer, sizeof buffer, 0)) > 0;)
            reply.append(buffer, size_t(n));
        return reply;
    }
    /// The same until `end`, for a connection that stays open.
    std::string receive_until(const std::string& end) const {
        std::string reply;
        char c;
        while (!reply.ends_with(end) && ::recv(socket_, &c, 1, 0) == 1) reply += c;
        return reply;
    }
    /// Whether the server has closed the connection by now.
    bool is_closed() const {
        char c;
        const ssize_t n = ::recv(socket_, &c, 1, MSG_PEEK | MSG_DONTWAIT);
        return n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK);
    }

private:
    int socket_ = -1;
    bool is_connected_ = false;
};

std::string request_text(const std::string& method, const std::string& target,
                         const std::string& body, const std::string& host = "localhost",
                         const std::string& token = "secret", bool keeps = false) {
    return method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" +
           (token.empty() ? "" : "Authorization: Bearer " + token + "\r\n") +
           (keeps ? "" : "Connection: close\r\n") +
           "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
}
int status_of(const std::string& reply) {
    constexpr size_t kBeforeStatus = sizeof("HTTP/1.1");
    return reply.size() > kBeforeStatus + 3 ? std::stoi(reply.substr(kBeforeStatus, 3)) : 0;
}

/// The status of the reply to a request; 0 without one. Reads at most `most` bytes of it.
int ask(int port, const std::string& method, const std::string& target, const std::string& body,
        size_t most = SIZE_MAX) {
    const Client client(port);
    client.send(request_text(method, target, body));
    return status_of(client.receive(most));
}

/// Answers all, unless it is to fail.
class StubHandler final : public Handler {
public:
    Admission admit(const Request& request) override {
        fail_if(fails_to_admit);
        Admission a;
        a.refusal = refuse(request, "secret", {"known.example"});
        a.has_token = !a.refusal && request.path().starts_with("/v1");
        a.is_events = a.has_token && request.path() == "/v1/events";
        a.brings_file = a.has_token && request.path() == "/v1/images";
        return a;
    }
    void handle(Request request, std::function<void(Reply)> done) override {
        fail_if(fails_to_handle);
        body_bytes = request.body.size();
        if (!forgets) done(Reply::json("{}"));
    }
    uint64_t revision() override { return ++revision_; }
    std::string event() override {
        fail_if(fails_to_tell);
        return "{}";
    }
    std::atomic<bool> fails_to_admit{false}, fails_to_handle{false}, fails_to_tell{false},
        forgets{false};
    std::atomic<size_t> body_bytes{0};  ///< Of the last request.

private:
    static void fail_if(bool fails) {
        if (fails) throw std::bad_alloc();
    }
    uint64_t revision_ = 0;
};

size_t open_descriptors() {
    using Entries = std::filesystem::directory_iterator;
    return size_t(std::distance(Entries("/proc/self/fd"), Entries()));
}

double cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Without file descriptors the server waits, and does not spin; it answers as soon as there are some.
TEST(Server, WaitsForFileDescriptors) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const auto serving = server.start(handler);
    // Clang's check of dynamic types opens a pipe where it meets a type for the first time, and reports a false type if
    // there is no descriptor for it. So all that the server does with a connection is done once, before they run out.
    const size_t open_at_first = open_descriptors();
    EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 200);
    ASSERT_TRUE(wait_for([&] { return open_descriptors() <= open_at_first; }));
    rlimit before{};
    getrlimit(RLIMIT_NOFILE, &before);
    const Client late(server.port());
    std::vector<int> all;
    {
        const Client first(server.port());
        rlimit few = before;
        few.rlim_cur = 64;
        setrlimit(RLIMIT_NOFILE, &few);
        for (int fd; (fd = ::dup(0)) >= 0;) all.push_back(fd);
    }
    // The descriptor of `first` is taken at once by what waits in vain.
    for (int fd; (fd = ::dup(0)) >= 0;) all.push_back(fd);
    ASSERT_FALSE(all.empty());
    ::close(all.back());
    const Client waiting(server.port());  // has the last descriptor
    all.pop_back();
    const double begin = cpu_seconds();
    waiting.send(request_text("GET", "/v1/state", ""));
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    EXPECT_LT(cpu_seconds() - begin, 0.3);
    for (const int fd : all) ::close(fd);
    setrlimit(RLIMIT_NOFILE, &before);
    EXPECT_EQ(status_of(waiting.receive()), 200);
}

/// Those who do not have the token, however many, neither keep others out nor take all descriptors.
TEST(Server, StrangersKeepNobodyOut) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const auto serving = server.start(handler);
    std::vector<std::unique_ptr<Client>> strangers;
    constexpr int kCount = 300;
    for (int i = 0; i < kCount; ++i) {
        strangers.push_back(std::make_unique<Client>(server.port()));
        // Nothing, a part of a header, and a request that is refused.
        if (i % 3 == 1) strangers.back()->send("GET / HTTP/1.1\r\nHost:");
        if (i % 3 == 2)
            strangers.back()->send(request_text("GET", "/v1/state", "", "localhost", "wrong"));
        if (i % 50 == 49) {
            EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 200) << i;
        }
    }
    const auto open = [&] {
        return std::count_if(strangers.begin(), strangers.end(),
                             [](const auto& c) { return !c->is_closed(); });
    };
    // Replies that are not read yet count as open here.
    EXPECT_TRUE(wait_for([&] { return open() <= Server::kMostStrangers + kCount / 3; })) << open();
    EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 200);
}

TEST(Server, KnownConnectionsHaveALimitOfTheirOwn) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const auto serving = server.start(handler);
    const std::string request = request_text("GET", "/v1/state", "", "localhost", "secret", true);
    {
        std::vector<std::unique_ptr<Client>> known;
        for (int i = 0; i < Server::kMostConnections; ++i) {
            known.push_back(std::make_unique<Client>(server.port()));
            known.back()->send(request);
            EXPECT_EQ(status_of(known.back()->receive_until("{}")), 200);
        }
        // Strangers do not take their place.
        std::vector<std::unique_ptr<Client>> strangers;
        for (int i = 0; i < 2 * Server::kMostStrangers; ++i)
            strangers.push_back(std::make_unique<Client>(server.port()));
        EXPECT_TRUE(wait_for([&] { return strangers.front()->is_closed(); }));
        known.front()->send(request);
        EXPECT_EQ(status_of(known.front()->receive_until("{}")), 200);
        EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 503);
    }
    EXPECT_TRUE(wait_for([&] { return ask(server.port(), "GET", "/v1/state", "") == 200; }));
}

/// An exception costs at most the connection whose turn it is.
TEST(Server, OutlivesExceptions) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const auto serving = server.start(handler);
    for (std::atomic<bool>* fails :
         {&handler.fails_to_admit, &handler.fails_to_handle, &handler.fails_to_tell}) {
        *fails = true;
        const char* target = fails == &handler.fails_to_tell ? "/v1/events" : "/v1/state";
        const Client client(server.port());
        client.send(request_text("GET", target, ""));
        client.receive();  // ends
        *fails = false;
        EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 200);
    }
    // An answer that never comes.
    handler.forgets = true;
    EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 0);
    handler.forgets = false;
    EXPECT_EQ(ask(server.port(), "GET", "/v1/state", ""), 200);
}

TEST(Server, OnlyRequestsThatBringFilesAreLong) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const Server::Serving serving = server.start(handler);
    constexpr size_t kLong = 3 << 20;
    const std::string body(kLong, 'x');
    EXPECT_EQ(ask(server.port(), "POST", "/v1/images?file=a.exr", body), 200);
    EXPECT_EQ(handler.body_bytes, kLong);
    EXPECT_EQ(ask(server.port(), "POST", "/v1/run", body), 413);

    // Of unknown length.
    const auto in_chunks = [&](const std::string& target, const std::string& token) {
        const Client client(server.port());
        client.send("POST " + target + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " +
                    token + "\r\nConnection: close\r\nTransfer-Encoding: chunked\r\n\r\n");
        for (int i = 0; i < 3; ++i) client.send("100000\r\n" + body.substr(0, 1 << 20) + "\r\n");
        client.send("0\r\n\r\n");
        return status_of(client.receive());
    };
    EXPECT_EQ(in_chunks("/v1/images?file=a.exr", "secret"), 200);
    EXPECT_EQ(handler.body_bytes, kLong);
    EXPECT_EQ(in_chunks("/v1/run", "secret"), 413);
    EXPECT_EQ(in_chunks("/v1/images?file=a.exr", "guess"), 413);
}

/// The header of a request with so many bytes, which do not follow.
std::string header_text(const std::string& target, uint64_t bytes,
                        const std::string& token = "secret") {
    return "POST " + target + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token +
           "\r\nContent-Length: " + std::to_string(bytes) + "\r\n\r\n";
}

TEST(Server, StatesTheLimitThatABodyExceeds) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const Server::Serving serving = server.start(handler);
    const auto refusal = [&](const std::string& target, uint64_t bytes, const std::string& token) {
        const Client client(server.port());
        client.send(header_text(target, bytes, token));
        return client.receive();
    };
    for (const uint64_t bytes : {uint64_t(kMostFileBytes) + 1, uint64_t(-1)}) {
        const std::string of_file = refusal("/v1/images?file=a.exr", bytes, "secret");
        EXPECT_EQ(status_of(of_file), 413);
        EXPECT_NE(of_file.find("larger than 512 MiB"), std::string::npos) << of_file;
        for (const std::string& other :
             {refusal("/v1/run", bytes, "secret"), refusal("/v1/images?file=a.exr", bytes, "no")}) {
            EXPECT_EQ(status_of(other), 413);
            EXPECT_NE(other.find("larger than 1 MiB"), std::string::npos) << other;
        }
    }
}

/// Files that are on their way have a limit together.
TEST(Server, ReadsFewLargeFilesAtATime) {
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const Server::Serving serving = server.start(handler);
    const std::string small = request_text("POST", "/v1/images?file=a.exr", "some bytes");
    const auto status = [&] {
        const Client client(server.port());
        client.send(small);
        return status_of(client.receive());
    };
    if (const auto free = available_memory(); free && *free < 4 * uint64_t(kMostFileBytes))
        GTEST_SKIP() << "there is not enough memory for large files";
    {
        std::vector<std::unique_ptr<Client>> large;
        for (size_t bytes = 0; bytes < kMostFileBytesAtATime; bytes += kMostFileBytes) {
            EXPECT_EQ(status(), 200);
            large.push_back(std::make_unique<Client>(server.port()));
            large.back()->send(header_text("/v1/images?file=a.exr", kMostFileBytes));
        }
        EXPECT_TRUE(wait_for([&] { return status() == 503; }));
        EXPECT_EQ(ask(server.port(), "POST", "/v1/run", "{}"), 200);
    }
    EXPECT_TRUE(wait_for([&] { return status() == 200; }));
    // Those that were answered do not count.
    for (int i = 0; i < 3; ++i) EXPECT_EQ(status(), 200);
}

/// From the start of the program, since malloc otherwise takes large blocks from freed memory of earlier tests, which counts as
/// taken.
const int kLargeBlocksAreMapped = ::mallopt(M_MMAP_THRESHOLD, 128 << 10);

/// A rendering goes on in the memory that a file would take.
TEST(Server, LeavesMemoryToRenderings) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    ASSERT_EQ(kLargeBlocksAreMapped, 1);
    StubHandler handler;
    Server server("127.0.0.1", 0);
    const Server::Serving serving = server.start(handler);
    constexpr uint64_t kMebibyte = 1 << 20;
    limit_memory(memory_for_data("/proc").value() + 100 * kMebibyte);
    const Client client(server.port());
    client.send(header_text("/v1/images?file=a.exr", 64 * kMebibyte));
    const std::string reply = client.receive();
    EXPECT_EQ(status_of(reply), 503);
    EXPECT_NE(reply.find("the file needs 192 MiB of memory"), std::string::npos) << reply;
    // Of a length that is not known.
    const Client chunks(server.port());
    chunks.send("POST /v1/images?file=a.exr HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer "
                "secret\r\nTransfer-Encoding: chunked\r\n\r\n");
    const std::string chunk = "100000\r\n" + std::string(kMebibyte, 'x') + "\r\n";
    for (int i = 0; i < 64 && !chunks.is_closed(); ++i) chunks.send(chunk);
    EXPECT_EQ(status_of(chunks.receive()), 503);
    EXPECT_EQ(ask(server.port(), "POST", "/v1/images?file=a.exr", "some bytes"), 200);
    unlimit_memory();
}

/// The page can be opened at each address that is printed.
TEST(Server, AnswersAtTheAddressesThatItStates) {
    for (const char* address : {"127.0.0.1", "0.0.0.0", "localhost", "::1", "::"}) {
        std::optional<Server> server;
        try {
            server.emplace(address, 0);
        } catch (const std::runtime_error&) {
            EXPECT_NE(std::string(address).find(':'), std::string::npos) << address;
            continue;  // no IPv6 here
        }
        StubHandler handler;
        const auto serving = server->start(handler);
        const bool is_everywhere =
            std::string(address) == "0.0.0.0" || std::string(address) == "::";
        EXPECT_EQ(server->is_local(), !is_everywhere) << address;
        const std::vector<std::string> urls = server->urls();
        ASSERT_FALSE(urls.empty());
        for (const std::string& url : urls) {
            const std::string host = url.substr(std::string("http://").size());
            std::string at = host.substr(0, host.rfind(':'));
            if (at.starts_with('[')) at = at.substr(1, at.size() - 2);
            EXPECT_NE(at, "0.0.0.0");
            EXPECT_NE(at, "::");
            if (at == "localhost") at = "127.0.0.1";
            Client client(server->port(), at);
            if (!client.is_connected()) continue;  // localhost may be ::1
            client.send(request_text("GET", "/v1/state", "", host));
            EXPECT_EQ(status_of(client.receive()), 200) << url;
            for (const auto& [name, status] :
                 {std::pair<std::string, int>{"evil.example", 403}, {"known.example:80", 200}}) {
                const Client other(server->port(), at);
                other.send(request_text("GET", "/v1/state", "", name));
                EXPECT_EQ(status_of(other.receive()), status) << url << " " << name;
            }
        }
        EXPECT_EQ(server->url("known.example"),
                  "http://known.example:" + std::to_string(server->port()));
    }
}

/// Runs are started, watched, traced again, stopped, discarded and removed by four clients at a time, while the scene is
/// loaded again and events are sent.
TEST(Server, AnswersSeveralClientsAtATime) {
    const TemporaryFolder folder;
    Session session(small_room, 2);
    Api api(session, {.token = "secret",
                      .scene_file = (folder.path() / "room.xml").string(),
                      .output_folder = folder.path().string(),
                      .reference = {},
                      .hosts = {}});
    Server server("127.0.0.1", 0);
    const Server::Serving serving = server.start(api);
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
                                   "depth", "normal", "length:2", "technique:hit-0-2"};
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
}

}  // namespace
}  // namespace etendue::test
