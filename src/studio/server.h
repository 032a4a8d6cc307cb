#pragma once
// An HTTP/1.1 server with one thread; the only file that knows sockets.

#include <memory>
#include <string>

#include "studio/http.h"

namespace etendue {

class Server {
public:
    static constexpr int kMostConnections = 64, kMostEventStreams = 4;
    static constexpr double kTimeout =
        10;  ///< Seconds without progress after which a connection is closed.

    /// Listens at the address; port 0 means any free one. Throws std::runtime_error where that is impossible.
    Server(const std::string& address, int port);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    int port() const;
    /// `http://address:port`
    std::string url() const;
    /// Serves from now on; `handler` must live until stop().
    void start(Handler& handler);
    /// Ends the thread. Replies that come later are lost.
    void stop();

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
