#pragma once
// An HTTP/1.1 server with one thread; the only file that knows sockets.

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "studio/http.h"

namespace etendue {

class Server {
public:
    /// Connections on which a request had the token; further ones are refused.
    static constexpr int kMostConnections = 64;
    /// Other connections. A further one takes the place of the oldest, so that nobody without the token keeps others out,
    /// or takes all of the program's file descriptors.
    static constexpr int kMostStrangers = 32;
    static constexpr int kMostEventStreams = 4;
    /// Seconds without progress after which a connection is closed.
    static constexpr double kTimeout = 10;

    /// Listens at an address, or that of a host name; port 0 means any free one. Throws std::runtime_error where that is
    /// impossible.
    Server(const std::string& address, int port);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    int port() const;
    /// Whether only this machine can reach it.
    bool is_local() const;
    /// `http://host:port`
    std::string url(const std::string& host) const;
    /// The same with its address, or each address of the machine if it listens at all of them.
    std::vector<std::string> urls() const;

    /// The server serves while this exists. Replies that come later are lost.
    class Serving {
    public:
        Serving(const Serving&) = delete;
        Serving& operator=(const Serving&) = delete;
        ~Serving();

    private:
        friend Server;
        explicit Serving(Server& server) : server_(server) {}
        Server& server_;
    };
    /// Once. `handler` must outlive the result.
    [[nodiscard]] Serving start(Handler& handler);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Reads one request from these bytes as the server would; a reply where it cannot be read.
struct ParsedRequest {
    std::optional<Request> request;
    std::optional<Reply> refusal;
};
ParsedRequest parse_request(std::string_view bytes);

}  // namespace etendue
